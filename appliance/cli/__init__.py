"""The commands of `bunraku`: play, check, pictures, provisioning, the list of sensors, and more."""
