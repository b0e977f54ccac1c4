"""What any other subpackage may use: checks of arguments, memory, progress, files."""
