"""Minimum dominating set of a graph: fewest nodes such that every node is or neighbours one.

A graph falls into connected components, which are independent. Nearly all components of a graph of
duplicate detections have a node that neighbours all others; that one is taken straight away.
The others are set covers for `keystab.matching.set_cover`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from keystab.matching.set_cover import first_minimum_cover


@dataclass(frozen=True)
class DominatingSet:
    """A dominating set and what is known about it.

    Attributes
    ----------
    members : ndarray of int
        Nodes of the set, ascending.
    lower_bound : int
        Proven: no dominating set has fewer members.
    canonical : bool
        Whether this is proven to be the first of all minimum sets.
    n_components, largest_component : int
        Connected components of the graph, and nodes of the largest one.
    n_milp : int
        Integer programs that were solved.
    """

    members: NDArray[np.intp]
    lower_bound: int
    canonical: bool
    n_components: int
    largest_component: int
    n_milp: int


def minimum_dominating_set(
    edges: NDArray[np.intp],
    preference: NDArray[np.intp],
    size_limit: int = 5000,
    time_limit: float = 60.0,
) -> DominatingSet:
    """First, in order of preference, of all minimum dominating sets of a graph.

    Parameters
    ----------
    edges : ndarray of int, shape (n_edges, 2)
        Pairs of neighbours, each pair once, no node with itself.
    preference : ndarray of int, shape (n_nodes,)
        All nodes, the preferred one first. Two sets of equal size are compared by the first place
        in this order where they differ.
    size_limit : int
        Components with more nodes than this are covered greedily.
    time_limit : float
        Seconds for one component, after which the best known set is taken.

    Returns
    -------
    DominatingSet
        With ``len(members) == lower_bound`` where the set is proven to be minimum.

    Examples
    --------
    A path of four nodes needs two of them; 1 and 2 would do as well as 0 and 3.

    >>> path = np.array([[0, 1], [1, 2], [2, 3]])
    >>> minimum_dominating_set(path, np.array([1, 2, 0, 3])).members
    array([1, 2])
    >>> minimum_dominating_set(path, np.array([3, 0, 1, 2])).members
    array([0, 3])
    """
    n = len(preference)
    n_components, label, size = _components(edges, n)
    degree = np.bincount(edges.ravel(), minlength=n)
    dominating = preference[(degree + 1 == size[label])[preference]]
    settled, first = np.unique(label[dominating], return_index=True)
    members = list(dominating[first])
    lower_bound, canonical, n_milp = len(members), True, 0
    for nodes, neighbourhoods in _problems(edges, label, preference, settled):
        cover = first_minimum_cover(neighbourhoods, size_limit, time_limit)
        members += list(nodes[cover.chosen])
        lower_bound += cover.lower_bound
        canonical &= cover.canonical
        n_milp += cover.n_milp
    return DominatingSet(
        members=np.sort(np.array(members, dtype=np.intp)),
        lower_bound=lower_bound,
        canonical=canonical,
        n_components=n_components,
        largest_component=int(size.max(initial=0)),
        n_milp=n_milp,
    )


def _components(edges: NDArray[np.intp], n: int) -> tuple[int, NDArray[np.intp], NDArray[np.intp]]:
    """Count connected components; tell the component of each node and the nodes of each."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    if n == 0:
        return 0, np.zeros(0, dtype=np.intp), np.zeros(0, dtype=np.intp)
    graph = coo_array((np.ones(len(edges), dtype=np.int8), (edges[:, 0], edges[:, 1])), (n, n))
    n_components, label = connected_components(graph, directed=False)
    return int(n_components), label, np.bincount(label, minlength=n_components)


def _problems(
    edges: NDArray[np.intp],
    label: NDArray[np.intp],
    preference: NDArray[np.intp],
    settled: NDArray[np.intp],
) -> Iterator[tuple[NDArray[np.intp], dict[int, int]]]:
    """Nodes of every component that is not settled, in order of preference, as a set cover.

    Candidate i stands for node i of the component and covers its neighbourhood, a bit mask over
    the nodes of the component.
    """
    is_open = ~np.isin(label, settled)
    nodes = preference[is_open[preference]]
    nodes = nodes[np.argsort(label[nodes], kind="stable")]
    starts = np.flatnonzero(np.diff(label[nodes], prepend=-1))
    number = np.zeros(len(label), dtype=np.intp)
    number[nodes] = np.arange(len(nodes)) - np.repeat(starts, np.diff(starts, append=len(nodes)))
    edges = edges[is_open[edges[:, 0]]]
    edges = edges[np.argsort(label[edges[:, 0]], kind="stable")]
    edge_starts = np.searchsorted(label[edges[:, 0]], label[nodes[starts]])
    for own, own_edges in zip(
        np.split(nodes, starts[1:]), np.split(number[edges], edge_starts[1:]), strict=True
    ):
        if not len(own):  # a split of nothing is one empty part
            continue
        masks = [1 << i for i in range(len(own))]
        for i, j in own_edges.tolist():
            masks[i] |= 1 << j
            masks[j] |= 1 << i
        yield own, dict(enumerate(masks))
