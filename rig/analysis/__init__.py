"""What data are asked: by the command line and the workbench alike."""
