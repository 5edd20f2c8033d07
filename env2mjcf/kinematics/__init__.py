"""Where bodies are: transforms, trees, configurations."""
