"""Bunraku: the box that lets a dancer puppeteer an AI dancer on stage."""
