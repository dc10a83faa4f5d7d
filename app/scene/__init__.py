"""What stands in the middle of the page: the window's events as a cloud, and a plane with a picture on it."""
