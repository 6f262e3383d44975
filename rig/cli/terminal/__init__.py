"""Options, messages, tables and live screens that the commands share."""
