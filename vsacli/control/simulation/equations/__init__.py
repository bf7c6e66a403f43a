"""The equations of motion of a closed loop, as text, recorded, or compiled, and steps through them."""
