"""Control laws on the state of a robot: gains, linear control, and what cancels the nonlinear dynamics."""
