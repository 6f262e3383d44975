"""What each procedure was run for: its own result, from the table that it recorded."""
