"""Longer questions, one module for each subject: what is asked, and when."""
