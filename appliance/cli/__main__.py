"""`python -m appliance.cli`: the command `bunraku`."""

from appliance.box.realtime import spare_the_collector

if __name__ == "__main__":
    spare_the_collector()
    from appliance.cli.app import main

    main()
