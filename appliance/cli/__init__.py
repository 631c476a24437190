"""What a person asks for at the keyboard: play, check, pictures, provisioning, the list of sensors."""
