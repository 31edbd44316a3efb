"""`python -m paws_perceive plan|poses|depth|hands`: one stream at a time, for `paws perceive` and for people."""

import argparse
import errno
import json
import os
import sys
import traceback

from . import Failure, __version__, adapters, plan

# Exit codes as those of `paws`: done, ran but found nothing, error.
DONE, NOTHING, ERROR = 0, 1, 2


def say(text):
    """A line for people, above the progress."""
    print(f"{text}", file=sys.stderr, flush=True)


def progress(what, done, count):
    """One line that changes where a person watches, else a line now and then."""
    if sys.stderr.isatty():
        end = "\n" if done == count else ""
        print(f"\r{what}: {done} of {count} frames ", end=end, file=sys.stderr, flush=True)
    elif done == count or done % 256 == 0:
        say(f"{what}: {done} of {count} frames")


def parser():
    """The arguments."""
    top = argparse.ArgumentParser(prog="paws_perceive", description=__doc__)
    top.add_argument("--version", action="version", version=__version__)
    commands = top.add_subparsers(dest="command", required=True)
    of = {name: commands.add_parser(name) for name in ("plan", "poses", "depth", "hands")}
    for one in of.values():
        one.add_argument("source", nargs="?" if one is of["plan"] else None)
        one.add_argument("--device", choices=("cpu", "gpu"), default="cpu")
        one.add_argument("--redo", action="append", default=[], metavar="STREAM")
    of["plan"].add_argument("--facts", help="what the source holds, as JSON")
    for name in ("plan", "depth"):
        of[name].add_argument("--depth-model", metavar="DIR", required=name == "depth")
    for name in ("poses", "depth", "hands"):
        of[name].add_argument("--cache", required=True, metavar="DIR")
    of["hands"].add_argument("--weights", metavar="DIR")
    for name in ("poses", "depth"):
        of[name].add_argument("--out", required=True, metavar="FILE")
    of["poses"].add_argument("--fps", type=float, default=10)
    of["poses"].add_argument("--ffmpeg", default="ffmpeg")
    return top


def act(args):
    """Does what the arguments say; an exit code."""
    if args.command == "plan":
        if args.facts is None and args.source is None:
            raise Failure("plan: name a source")
        facts = json.loads(args.facts) if args.facts is not None else plan.facts_of(args.source)
        sys.stdout.write(plan.text(facts, args.device, args.redo, args.depth_model))
        return DONE
    redo = args.command in args.redo
    adapters.package("numpy", adapters.of(args.command).ABOUT)
    if args.command == "poses":
        from . import poses

        found = poses.run(args.source, args.out, args.cache, args.device, redo, args.fps, say, args.ffmpeg)
        return DONE if found else NOTHING
    if args.command == "depth":
        from . import depth

        found = depth.run(args.source, args.out, args.cache, args.depth_model, args.device, redo, say, progress)
        return DONE if found else NOTHING
    from . import hands

    found = hands.run(args.source, args.cache, args.device, args.weights, redo, say, progress)
    if found:
        return DONE
    say(
        "hands: none is seen in any frame, and so none is in the recording: are the hands in view while they open things? Is the "
        "picture upright (--rotate)?"
    )
    return NOTHING


def main():
    """The command."""
    # Words of libraries that say nothing to the user.
    os.environ.setdefault("GLOG_minloglevel", "2")
    os.environ.setdefault("TF_CPP_MIN_LOG_LEVEL", "2")
    args = parser().parse_args()
    try:
        return act(args)
    except Failure as failure:
        say(str(failure))
    except OSError as error:
        full = error.errno in (errno.ENOSPC, errno.EDQUOT)
        way = "the disk is full: make room, or name another folder with --cache; run the same command again" if full else error.strerror
        say(f"{error.filename or getattr(args, 'cache', args.source)}: {way}")
    except MemoryError:
        say("out of memory: close other programs; what is finished stays in the cache, run the same command again")
    except KeyboardInterrupt:
        say("stopped; what is finished stays in the cache, run the same command again")
    except Exception:  # An exit code of 1 would say that it ran.
        traceback.print_exc()
    return ERROR


if __name__ == "__main__":
    sys.exit(main())
