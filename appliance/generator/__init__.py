"""The generator: a separate process that makes motion ahead for the stage."""
