"""The models under test of plants that the project has no component for."""
