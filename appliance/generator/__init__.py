"""The generator: makes motion ahead for the stage, in a process of its own."""
