"""The technician's page: a process of its own, which this release leaves empty."""
