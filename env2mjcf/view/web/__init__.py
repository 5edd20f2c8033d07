"""The viewer on a web page."""
