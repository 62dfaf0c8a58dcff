"""Clients of the live page that behave badly, as plain sockets."""

import socket
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from urllib.parse import urlsplit

HANDSHAKE = (
    "GET /live HTTP/1.1\r\nHost: {host}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
    "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n\r\n"
)


@contextmanager
def stalled(url: str, count: int, request: str = HANDSHAKE) -> Iterator[list[socket.socket]]:
    """Open connections that send a request, read the first bytes of an answer to it and then nothing more."""
    where, clients = urlsplit(url), []
    with ExitStack() as stack:
        for _ in range(count):
            client = stack.enter_context(socket.socket())
            client.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
            client.settimeout(30)
            client.connect((str(where.hostname), where.port))
            client.sendall(request.format(host=where.netloc).encode())
            if request == HANDSHAKE:
                assert b"101 Switching Protocols" in client.recv(1024)
            clients.append(client)
        yield clients
