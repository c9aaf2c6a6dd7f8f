"""What tests of nodes rest on: each in a domain of its own."""

from itertools import islice

import pytest

from ros_support import DOMAINS, domains_of


@pytest.mark.parametrize("workers", [1, 2, 3, 8, 16])
def test_no_two_workers_share_a_domain(workers: int) -> None:
    """The nodes of one test would hear those of another."""
    own = [set(islice(domains_of(k, workers, 12345), 500)) for k in range(workers)]
    every = set().union(*own)
    assert every <= set(DOMAINS) and len(every) == sum(map(len, own))
    assert all(len(few) == len(DOMAINS) // workers for few in own)
