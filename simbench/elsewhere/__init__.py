"""Pipelines that are run elsewhere: the messages of a recording as a file, and the results that come back."""
