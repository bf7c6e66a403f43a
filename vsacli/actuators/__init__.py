"""What drives a joint: springs, and the kinds of actuator, one file each."""
