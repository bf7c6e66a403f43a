"""The vocabulary that everything shares: errors, units, flags, variables, arrays, and files written whole."""
