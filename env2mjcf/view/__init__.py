"""Pictures of scenes; needs the extra `view`, and GL only in processes of its own."""
