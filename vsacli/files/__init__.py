"""Recognition, description and checks of files, and templates to begin with."""
