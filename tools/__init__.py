"""For engineers, in the checkout: they write the wire's generated files and the documentation's pictures."""
