# Sourced by scripts that put something together in a folder, with their arguments: sets `out` from --out DIR, and `build_folder`, both
# absolute, and goes to the root of the repository. Exit code 2 for another argument.

say() { echo "$(basename "$0" .sh): $*" >&2; }
absolute() { case $1 in /*) echo "$1" ;; *) echo "$PWD/$1" ;; esac; }

out=
while [ $# -gt 0 ]; do
    case $1 in
        --out)
            [ $# -ge 2 ] || { say "--out needs a value"; exit 2; }
            out=$(absolute "$2")
            shift
            ;;
        *)
            say "unknown argument $1 (known: --out)"
            exit 2
            ;;
    esac
    shift
done
cd "$(dirname "$0")/.."
build_folder=$(absolute "${CARGO_TARGET_DIR:-target}")
