# Read by bash before install.sh (BASH_ENV): at its command number $CUT_AT the power fails; counts where CUT_AT is 0.
if [ "${0##*/}" = install.sh ]; then
    commands=0
    trap 'commands=$((commands + 1))
        if [ "$commands" = "$CUT_AT" ]; then "$CUT_PYTHON" "$CUT_PROGRAM" "$CUT_DISK"; kill -KILL $$; fi
        if [ "$CUT_AT" = 0 ]; then echo "$commands" >"$CUT_COUNT"; fi' DEBUG
    set -o functrace
fi
