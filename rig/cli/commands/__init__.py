"""One command a file, named as on the command line; its `command` is loaded when it is called."""
