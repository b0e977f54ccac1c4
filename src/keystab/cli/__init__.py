"""The command `keystab`."""
