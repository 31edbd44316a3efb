"""`python -m paws_perceive plan|poses|depth|hands|masks|lines`: one stream at a time, for `paws perceive` and for people."""

import argparse
import errno
import json
import os
import pathlib
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


STREAMS = ("poses", "depth", "hands", "masks", "lines")


def parser():
    """The arguments."""
    top = argparse.ArgumentParser(prog="paws_perceive", description=__doc__)
    top.add_argument("--version", action="version", version=__version__)
    commands = top.add_subparsers(dest="command", required=True)
    of = {name: commands.add_parser(name) for name in ("plan", *STREAMS)}
    for one in of.values():
        one.add_argument("source", nargs="?" if one is of["plan"] else None)
        one.add_argument("--device", choices=("cpu", "gpu"), default="cpu")
        one.add_argument("--redo", action="append", default=[], metavar="STREAM")
        one.add_argument("--weights", metavar="DIR")
        one.add_argument("--accept-licence", action="append", default=[], metavar="NETWORK")
    of["plan"].add_argument("--facts", help="what the source holds, as JSON")
    of["plan"].add_argument("--make", action="append", default=[], metavar="STREAM")
    of["plan"].add_argument("--by", action="append", default=[], metavar="STREAM=NETWORK")
    for name in ("plan", "depth"):
        of[name].add_argument("--depth-model", metavar="DIR", required=name == "depth")
    for name in STREAMS:
        of[name].add_argument("--cache", required=True, metavar="DIR")
    for name in ("poses", "hands", "lines"):
        of[name].add_argument("--by", metavar="NETWORK")
    for name in ("depth", "masks", "lines"):
        of[name].add_argument("--frames", metavar="FILE", help="numbers of the frames, as `paws frames --json` prints them")
    for name in ("poses", "depth"):
        of[name].add_argument("--out", required=name == "poses", metavar="FILE")
    of["depth"].add_argument("--most", type=int, metavar="N", help="of a folder of images take so many, evenly spread")
    of["masks"].add_argument("--words", default="", metavar="WORD,WORD", help="furniture that masks are made of")
    of["poses"].add_argument("--fps", type=float, default=10)
    of["poses"].add_argument("--ffmpeg", default="ffmpeg")
    return top


def planned(args):
    """Prints what would run."""
    if args.facts is None and args.source is None:
        raise Failure("plan: name a source")
    facts = json.loads(args.facts) if args.facts is not None else plan.facts_of(args.source)
    wishes = plan.Wishes(args.device, tuple(args.redo), args.depth_model, args.weights, tuple(args.make), tuple(args.by))
    sys.stdout.write(plan.text(facts, wishes))
    return DONE


def run_depth(args, common):
    """Depth of a folder of images, or of a recording."""
    from . import depth, recording

    if pathlib.Path(args.source, "cameras.json").is_file():
        frames = recording.numbers_of(args.frames) if args.frames else None
        return depth.run_recording(args.source, args.cache, args.depth_model, **common, frames=frames)
    if args.out is None:
        raise Failure("depth: of a folder of images, --out FILE says where to write what was found")
    return depth.run(args.source, args.out, args.cache, args.depth_model, **common, most=args.most)


def act(args):
    """Does what the arguments say; an exit code."""
    if args.command == "plan":
        return planned(args)
    by = getattr(args, "by", None)
    adapters.package("numpy", adapters.of(args.command, by).ABOUT)
    common = {"device": args.device, "redo": args.command in args.redo, "say": say}
    accepted = tuple(args.accept_licence)
    if args.command == "poses":
        from . import poses

        more = {"by": by, "weights": args.weights, "accepted": accepted}
        found = poses.run(args.source, args.out, args.cache, **common, fps=args.fps, ffmpeg=args.ffmpeg, **more)
        return DONE if found else NOTHING
    common["progress"] = progress
    if args.command == "depth":
        return DONE if run_depth(args, common) else NOTHING
    if args.command == "hands":
        from . import hands

        found = hands.run(args.source, args.cache, weights=args.weights, by=by, accepted=accepted, **common)
        return DONE if found else none_found()
    from . import recording

    frames = recording.numbers_of(args.frames) if args.frames else None
    if args.command == "masks":
        from . import masks

        words = tuple(args.words.split(","))
        found = masks.run(args.source, args.cache, weights=args.weights, frames=frames, words=words, **common)
        return DONE if found else NOTHING
    from . import lines

    return DONE if lines.run(args.source, args.cache, weights=args.weights, frames=frames, by=by, **common) else NOTHING


def none_found():
    """Says that no hand is seen; an exit code."""
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
