"""Models of systems that settle, as users write them: under test, not the judge."""
