"""Recognition, description and validation of files, and templates for new ones."""
