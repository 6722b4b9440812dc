"""What laws want to first order, along the course on which a model follows a record."""
