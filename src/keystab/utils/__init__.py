"""What any room may use: checks of arguments, memory, progress, files."""
