"""Compose, run and judge the components: records, identification, the command line."""
