"""Who does not read what the server sends is dropped; who reads stays."""

import threading

from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from server.config import ServerConfig
from tests.support.fake_wire import FakeWire, telling
from tests.support.running_server import eventually, running_server


def test_a_page_that_does_not_read_is_dropped_and_one_that_reads_stays():
    wire = FakeWire()
    config = ServerConfig(unread_s=2.0, page_rate_hz=100.0)
    with running_server(wire, config) as server, telling(wire), server.client(user="ann") as client:

        def opened():
            headers = {"cookie": server.cookie(client)}
            address = server.socket_address + "/ws"
            return connect(address, origin=server.address, additional_headers=headers, proxy=None, close_timeout=0.1)

        def look(page):
            try:
                for _ in page:
                    pass
            except ConnectionClosed:
                pass

        # A page of the library's reads ahead a few messages, and answers pings only as far as it has read.
        with opened() as reading, opened():
            looking = threading.Thread(target=look, args=(reading,))
            looking.start()
            eventually(lambda: client.get("/api/state").json()["viewers"] == 2)
            eventually(lambda: client.get("/api/state").json()["viewers"] == 1)
            said = [line["text"] for line in client.get("/api/events").json()["events"]]
            assert [text for text in said if "did not read" in text] == [
                "a page of ann was closed: it did not read what it was sent"
            ]
            assert looking.is_alive()
        looking.join()
