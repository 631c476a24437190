"""Material: motion that a network makes ahead, as loops that playback takes like those of phrases."""
