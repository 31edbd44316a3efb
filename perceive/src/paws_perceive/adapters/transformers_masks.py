"""Masks by Grounding DINO (boxes of what words name) and SAM 2 (the pixels in each box), both of `transformers`.

The models are two folders, `grounding-dino` and `sam2`, in the folder of weights, each as its authors publish it; nothing is fetched.
"""

import pathlib

from .. import batches
from . import About, files_of, from_folder, loaded, offline, package, torch_on, within_memory

DETECTOR, SEGMENTER = "grounding-dino", "sam2"
# As Grounding DINO's authors have it.
BOX_SCORE = 0.35
# Words that are asked for in one question, which holds 256 pieces of words.
WORDS = 60
# Boxes whose masks are asked for at once.
BOXES = 16

ABOUT = About(
    name="grounded-sam2",
    stream="masks",
    package="transformers>=4.57",
    extra="masks",
    licence="Apache-2.0 (Grounding DINO, SAM 2)",
    needs="colour images; folders grounding-dino and sam2 in --weights DIR",
    gives="a class a pixel: furniture by its word, 255 for hands, people and animals",
    devices=("gpu", "cpu"),
    # Both on one core; a GPU takes a thirtieth.
    secs_per_frame=15.0,
    memory_mb=4000,
    version=1,
    weights_from="two folders as their authors publish them: --weights DIR with grounding-dino/ and sam2/ in it "
    "(IDEA-Research/grounding-dino-tiny, facebook/sam2.1-hiera-small)",
)
ENDINGS = (".safetensors", ".json", ".txt")


def has(weights):
    """Whether a folder of weights has both models."""
    return bool(weights) and all((pathlib.Path(weights) / name).is_dir() for name in (DETECTOR, SEGMENTER))


def digests(weights):
    """SHA-256 of the files of both models."""
    out = {}
    for name in (DETECTOR, SEGMENTER):
        found = files_of(pathlib.Path(weights) / name, ENDINGS, ".safetensors", f"--weights {weights}: {name}")
        out.update({f"{name}/{file}": digest for file, digest in found.items()})
    return out


def spans(ids, between, around, count):
    """Places of each word's tokens among the tokens of a question "one. two. three."; `between`: the token of the full stop.

    `around`: tokens that are no words. Of `count` words.
    """
    out = [[]]
    for place, token in enumerate(ids):
        if token == between:
            out.append([])
        elif token not in around:
            out[-1].append(place)
    return out[:count]


class Network:
    """Both loaded models."""

    def __init__(self, torch, detector, segmenter, device):
        self._torch, self._device = torch, device
        self._detector, self._words = detector
        self._segmenter, self._boxes = segmenter

    def run(self, image, words):
        """What an RGB image shows of some words (lower case): (word, score, mask of rows x columns)."""
        import numpy as np  # Not needed to say what this is.

        found = self._detect(image, words)
        out = []
        masks = batches.each(
            [box for _, _, box in found],
            BOXES,
            lambda boxes: self._masks(image, boxes),
            lambda box: batches.smaller("masks", image.shape[1], image.shape[0]),
            lambda text: None,
        )
        for (word, score, _), (_, mask) in zip(found, masks):
            out.append((word, score, np.asarray(mask, bool)))
        return out

    def _detect(self, image, words):
        """Boxes (left, top, right, bottom; pixels) with the word that each fits best, and how well, of 0 to 1."""
        out = []
        for first in range(0, len(words), WORDS):
            some = words[first : first + WORDS]
            with within_memory(self._torch), self._torch.no_grad():
                inputs = self._words(images=image, text=". ".join(some) + ".", return_tensors="pt").to(self._device)
                found = self._detector(**inputs)
            scores, boxes = found.logits[0].float().sigmoid().cpu().numpy(), found.pred_boxes[0].float().cpu().numpy()
            tokenizer = self._words.tokenizer
            between = tokenizer.convert_tokens_to_ids(".")
            places = spans(inputs["input_ids"][0].tolist(), between, set(tokenizer.all_special_ids), len(some))
            rows, columns = image.shape[:2]
            for score, (u, v, width, height) in zip(scores, boxes):
                by_word = [max((float(score[at]) for at in span), default=0.0) for span in places]
                best = max(range(len(by_word)), key=lambda i: by_word[i])
                if by_word[best] >= BOX_SCORE:
                    sides = [u - width / 2, v - height / 2, u + width / 2, v + height / 2]
                    box = [float(side * size) for side, size in zip(sides, (columns, rows, columns, rows))]
                    out.append((some[best], by_word[best], box))
        return out

    def _masks(self, image, boxes):
        with within_memory(self._torch), self._torch.no_grad():
            inputs = self._boxes(images=image, input_boxes=[boxes], return_tensors="pt").to(self._device)
            out = self._segmenter(**inputs, multimask_output=False)
            masks = self._boxes.post_process_masks(out.pred_masks.float().cpu(), inputs["original_sizes"].cpu())[0]
        return [mask[0].numpy() for mask in masks]


def load(device="cpu", weights=None):
    """Both models of the folder of weights."""
    offline()
    torch, on = torch_on(device, ABOUT)
    transformers = package("transformers", ABOUT)
    folders = [pathlib.Path(weights) / name for name in (DETECTOR, SEGMENTER)]
    detector = loaded(transformers.AutoModelForZeroShotObjectDetection, folders[0]).to(on).eval()
    segmenter = loaded(transformers.Sam2Model, folders[1]).to(on).eval()
    words, boxes = from_folder(transformers.AutoProcessor, folders[0]), from_folder(transformers.Sam2Processor, folders[1])
    return Network(torch, (detector, words), (segmenter, boxes), on)
