#!/bin/sh
# Runs its arguments. zig makes a precompiled header only without -c, which CMake always gives.
case " $* " in *" c++-header "*)
  for word do
    shift
    [ "$word" = -c ] || set -- "$@" "$word"
  done ;;
esac
exec "$@"
