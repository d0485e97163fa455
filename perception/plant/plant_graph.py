"""The known vines as graphs: trunk → cordon → spur → cane → node, with places, radii and how sure they are."""

import networkx as nx
import numpy as np

from perception.plant.map import Estimate, PlantMap

#: A single look says nothing about scatter; it is taken to be good to this (m).
_SINGLE = 0.003


def vine_graphs(known: PlantMap) -> dict[int, nx.DiGraph]:
    """One tree a vine, from its trunk outwards.

    Every vertex has `kind`, `position` (3, m, odom), `covariance` (3×3, m²: of the mean) and `looks`; canes have
    `radius` and `radius_deviation` (m) and nodes `arc`, the distance from the cane's base (m).

    Args:
        known: What was seen so far.
    """
    graphs: dict[int, nx.DiGraph] = {}
    for spur in known.spurs:
        vine = spur.number.vine
        graph = graphs.get(vine)
        if graph is None:
            graph = graphs[vine] = nx.DiGraph(vine=vine)
            trunk = known.trunks.get(vine)
            if trunk is not None:
                _add(graph, "trunk", "trunk", trunk)
            middle = Estimate.of(np.mean([s.position.mean for s in known.spurs if s.number.vine == vine], axis=0))
            _add(graph, "cordon", "cordon", middle, "trunk" if trunk is not None else None)
        name = f"spur {spur.number.spur}"
        _add(graph, name, "spur", spur.position, "cordon")
        for number, cane in enumerate(spur.canes, 1):
            branch = f"{name} cane {number}"
            _add(graph, branch, "cane", cane.base, name)
            scatter = float(np.sqrt(cane.radius.covariance[0, 0] / cane.radius.looks))
            graph.nodes[branch].update(radius=float(cane.radius.mean[0]), radius_deviation=scatter)
            shape, before = cane.as_cane(), branch
            for count, node in enumerate(cane.trusted()):
                arc = float(node.arc.mean[0])
                along = shape.tangent(arc)
                spread = node.arc.covariance[0, 0] * np.outer(along, along)
                bud = f"{branch} node {count}"
                _add(graph, bud, "node", Estimate(shape.at(arc), spread, node.arc.looks), before)
                graph.nodes[bud]["arc"] = arc
                before = bud
    return graphs


def _add(graph: nx.DiGraph, name: str, kind: str, place: Estimate, parent: str | None = None) -> None:
    spread = place.covariance / place.looks if place.looks > 1 else _SINGLE**2 * np.eye(len(place.mean))
    graph.add_node(name, kind=kind, position=place.mean, covariance=spread, looks=place.looks)
    if parent is not None:
        graph.add_edge(parent, name)
