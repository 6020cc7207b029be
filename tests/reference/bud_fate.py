"""Bud fate in plain Python: Palubicki et al. 2009, section 4.2, as printed."""

from __future__ import annotations

from collections.abc import Callable

from tests.reference.plant import Node

Share = dict[tuple[int, str], float]


def light_of_terminal(node: Node) -> float:
    """Q_m: light of the terminal bud, or of all that the continuing axis bears."""
    if node.onward:
        return light_of(node.onward)
    return node.light if node.terminal and node.room_terminal else 0.0


def light_of_lateral(node: Node) -> float:
    """Q_l: light of the lateral bud, or of all that the branch bears."""
    if node.branch:
        return light_of(node.branch)
    return node.light if node.lateral and node.room_lateral else 0.0


def light_of(node: Node) -> float:
    """Cumulative light Q that flows down through an internode."""
    return light_of_terminal(node) + light_of_lateral(node)


def borchert_honda(
    node: Node,
    v: float,
    bias: Callable[[int], float],
    max_order: int,
    out: Share,
) -> None:
    """Divide v at a branching point and go on into both arms; `out` holds what buds get."""
    lam = bias(node.order)
    main = lam * light_of_terminal(node)
    side = (1.0 - lam) * light_of_lateral(node)
    if node.lateral and node.order >= max_order:
        side = 0.0
    v_main = v * main / (main + side) if main + side > 0.0 else 0.0
    v_side = v * side / (main + side) if main + side > 0.0 else 0.0
    if node.onward:
        borchert_honda(node.onward, v_main, bias, max_order, out)
    elif node.terminal:
        out[node.index, "main"] = v_main
    if node.branch:
        borchert_honda(node.branch, v_side, bias, max_order, out)
    elif node.lateral:
        out[node.index, "side"] = v_side


def weight_of_place(k: int, n: int, w_max: float, w_min: float, kappa: float) -> float:
    """Fig. 8c: w_max for the first (k = 0), a straight line down to w_min at kappa N."""
    if k >= kappa * n:
        return w_min
    return w_max - (w_max - w_min) * k / (kappa * n)


def priority(
    head: Node,
    v: float,
    under_control: Callable[[int], bool],
    place_weight: Callable[[int, int], float],
    max_order: int,
    out: Share,
) -> None:
    """Divide v among all that an axis supports, then within each of its branches."""
    supported: list[tuple[Node, str, float, float]] = []
    for node in head.axis():
        buds = sum(n.buds for n in node.branch.above()) if node.branch else int(node.lateral)
        if buds == 0 or (node.lateral and node.order >= max_order):
            continue
        q = light_of_lateral(node)
        supported.append((node, "side", q, q / buds))
    last = head.axis()[-1]
    if last.terminal:
        q = light_of_terminal(last)
        supported.append((last, "main", q, q))
    supported.sort(key=lambda item: -item[3])
    if last.terminal and under_control(head.order):
        supported.sort(key=lambda item: item[1] != "main")
    n = len(supported)
    shares = [q * place_weight(k, n) for k, (_, _, q, _) in enumerate(supported)]
    for (node, arm, _, _), share in zip(supported, shares, strict=True):
        got = v * share / sum(shares) if sum(shares) > 0.0 else 0.0
        if arm == "side" and node.branch:
            priority(node.branch, got, under_control, place_weight, max_order, out)
        else:
            out[node.index, arm] = got
