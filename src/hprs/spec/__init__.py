"""The task language: its data, its parser and printer, and what can be known of a task."""
