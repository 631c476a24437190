"""The experiments of 'Puppeteering an AI', section 4: excerpts, families, the paper's claims in figures."""
