"""What is on disk beside what a user asked for: a cache that is checked, and folders that go with their process."""
