"""The chain of joints and links, its file, and its making from a URDF."""
