"""The numbers of a robot from records of its motion: motors, springs, friction and links."""
