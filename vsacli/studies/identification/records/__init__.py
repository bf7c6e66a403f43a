"""Records of a robot: read, judged and conditioned."""
