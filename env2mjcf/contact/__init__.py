"""Contact queries: one configuration or many, along an edge, along a path."""
