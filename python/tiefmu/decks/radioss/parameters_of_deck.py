"""/PARAMETER of a Radioss deck: what &name stands for in its cards."""

from ...schema import shortened
from .. import parameters
from .cards import Block

TYPES = {"INTEGER": "I", "REAL": "R", "INT_EXPR": "I", "REAL_EXPR": "R", "TEXT": "C"}


def define(blocks: list[Block]):
    """Gives every block the parameters of the deck, and of the submodels that it is in. Expressions may use parameters
    that stand before them."""
    whole = parameters.Scope()
    local: dict[tuple[int, ...], parameters.Scope] = {(): whole}

    def scope(inside: tuple[int, ...]) -> parameters.Scope:
        if inside not in local:
            local[inside] = parameters.Scope(scope(inside[:-1]))
        return local[inside]

    found = [block for block in blocks if block.key[0] == "PARAMETER"]
    for block in found:
        own = block.word(1) == "LOCAL"
        read(block, scope(block.offsets.inside) if own else whole, scope(block.offsets.inside))
    if found:
        for block in blocks:
            block.scope = scope(block.offsets.inside)


def read(block: Block, target: parameters.Scope, known: parameters.Scope):
    """One block: its name, and its value, or an expression of up to ten lines."""
    kind = TYPES.get(block.word(2))
    if kind is None:
        block.fail(f"type '{shortened(block.word(2))}' is not understood; {', '.join(TYPES)} are")
    _, cards = block.titled()
    line = cards.need(0).decode("latin-1")
    name, text = line[:10].strip().lower(), line[10:].strip()
    if not name:
        block.fail("has no name", cards.first)
    if kind == "C":
        target.names[name] = "".join(cards.need(card).decode("latin-1") for card in range(1, len(cards)))
        return
    try:
        if block.word(2).endswith("EXPR"):
            rest = (cards.need(card).decode("latin-1").strip() for card in range(1, len(cards)))
            target.names[name] = parameters.typed(kind, parameters.evaluate(text + "".join(rest), known))
        else:
            target.names[name] = parameters.typed(kind, text)
    except KeyError as error:
        block.fail(f"parameter {name}: {shortened(str(error.args[0]))} is not in the deck", cards.first)
    except (ValueError, OverflowError):
        block.fail(f"parameter {name}: expected a number, found '{shortened(text)}'", cards.first)
