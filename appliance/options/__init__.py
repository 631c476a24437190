"""Options that commands of the box, the studio and the simulation share."""
