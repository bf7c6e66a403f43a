"""User-defined mechanisms: the robot file contains the elastic energy as an expression."""
