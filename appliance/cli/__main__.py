"""`python -m appliance.cli`: the command `bunraku`."""

from appliance.cli.app import main

if __name__ == "__main__":
    main()
