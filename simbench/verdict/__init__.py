"""Is the new version as good as the old one? Pure statistics over runs; docs/verdict.md says what is
promised."""
