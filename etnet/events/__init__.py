"""Event recordings: what they hold and how any file becomes one."""
