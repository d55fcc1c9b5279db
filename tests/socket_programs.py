"""What a program does with sockets, on any controller: the tests of the simulator and of plcrt."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from plctool.controller import Controller

NO_ERROR, INVALID_ADDR, INVALID_HANDLE, CONNECT_ERROR, NO_CONNECTION = 0, 6002, 6003, 6014, 6019

LONG = 6000  # bytes: several calls
PROGRAM = f"""
PROGRAM Main
VAR
    port : UINT; address : NBS.IP_ADDR := (sAddr := '127.0.0.1');
    serve, connect, talk : BOOL; echoed, got : UDINT; good : BOOL; readError : UDINT;
    server : NBS.TCP_Server; accepted : NBS.TCP_Connection; client : NBS.TCP_Client;
    serverRead, clientRead : NBS.TCP_Read; serverWrite, clientWrite : NBS.TCP_Write;
    sent, answer : ARRAY[0..{LONG - 1}] OF BYTE; buffer : ARRAY[0..499] OF BYTE; i : UDINT;
    listen : BOOL; peer : NBS.UDP_Peer; receive : NBS.UDP_Receive; send : NBS.UDP_Send; datagrams : UDINT;
    shout : BOOL; to : NBS.IP_ADDR; toPort : UINT; sendError : UDINT; small : UDINT := 500;
END_VAR
// a server that sends back what comes
server(xEnable := serve, uiPort := port);
accepted(xEnable := serve AND server.xActive AND NOT serverRead.xError, hServer := server.hServer);
serverRead(xEnable := accepted.xActive AND NOT serverWrite.xBusy, hConnection := accepted.hConnection,
    szSize := SIZEOF(buffer), pData := ADR(buffer));
serverWrite(xExecute := serverRead.xReady, hConnection := accepted.hConnection, szSize := serverRead.szCount,
    pData := ADR(buffer));
IF serverRead.xReady THEN echoed := echoed + serverRead.szCount; END_IF
IF serverRead.xError THEN readError := serverRead.eError; END_IF
// its client
client(xEnable := connect, ipAddr := address, uiPort := port, udiTimeOut := 20000000);
IF NOT talk THEN
    got := 0;
    good := TRUE;
    FOR i := 0 TO {LONG - 1} DO sent[i] := UDINT_TO_BYTE(i * 7 + i / 251); END_FOR
END_IF
clientWrite(xExecute := talk AND client.xActive, hConnection := client.hConnection, szSize := SIZEOF(sent),
    pData := ADR(sent));
clientRead(xEnable := client.xActive, hConnection := client.hConnection, szSize := SIZEOF(answer),
    pData := ADR(answer));
IF clientRead.xReady THEN
    FOR i := 1 TO clientRead.szCount DO
        good := good AND answer[i - 1] = UDINT_TO_BYTE((got + i - 1) * 7 + (got + i - 1) / 251);
    END_FOR
    got := got + clientRead.szCount;
END_IF
// datagrams that are sent back
peer(xEnable := listen, uiPort := port);
receive(xEnable := peer.xActive, hPeer := peer.hPeer, szSize := small, pData := ADR(buffer));
IF receive.xReady THEN datagrams := datagrams + 1; END_IF
IF shout THEN
    send(xExecute := TRUE, hPeer := peer.hPeer, ipAddr := to, uiPort := toPort, szSize := 3, pData := ADR('abc'));
    IF send.xDone OR send.xError THEN sendError := send.eError; shout := FALSE; END_IF
ELSE
    send(xExecute := receive.xReady AND receive.uiPortFrom <> port, hPeer := peer.hPeer, ipAddr := receive.ipFrom,
        uiPort := receive.uiPortFrom, szSize := receive.szCount, pData := ADR(buffer));
END_IF
END_PROGRAM
"""


class ProgramSockets:
    """Needs the fixtures `plc`, with PROGRAM in it, and `port`, one that is free."""

    def wait(self, plc: Controller, condition: Callable[[], Any]) -> None:
        raise NotImplementedError

    def write(self, plc: Controller, **values: object) -> None:
        plc.write({f"Main.{name}": value for name, value in values.items()})

    def test_program_talks_to_its_own_server_and_learns_that_the_peer_closed(self, plc: Controller, port: int) -> None:
        self.write(plc, port=port, serve=True)
        self.wait(plc, lambda: plc.read("Main.server.xActive"))
        self.write(plc, connect=True, talk=True)
        self.wait(plc, lambda: plc.read("Main.got") == LONG)
        assert plc.read("Main.good") and plc.read("Main.clientWrite.xDone") and plc.read("Main.echoed") == LONG
        self.write(plc, connect=False)
        self.wait(plc, lambda: plc.read("Main.readError") == NO_CONNECTION and not plc.read("Main.client.xBusy"))
        self.write(plc, talk=False, connect=True)  # the server takes the next one
        self.wait(plc, lambda: plc.read("Main.accepted.xActive") and plc.read("Main.client.xActive"))

    def test_connection_without_a_server_and_a_wrong_address_are_errors(self, plc: Controller, port: int) -> None:
        self.write(plc, port=port, connect=True)
        self.wait(plc, lambda: plc.read("Main.client.xError"))
        assert plc.read("Main.client.life.calls.code") == CONNECT_ERROR
        self.write(plc, connect=False)
        self.wait(plc, lambda: not plc.read("Main.client.xError"))
        plc.write({"Main.address.sAddr": "1.2.3.400", "Main.connect": True})
        self.wait(plc, lambda: plc.read("Main.client.life.calls.code") == INVALID_ADDR)

    def test_datagram_to_itself_arrives_and_one_without_address_is_refused(self, plc: Controller, port: int) -> None:
        self.write(plc, port=port, listen=True, toPort=port)
        self.wait(plc, lambda: plc.read("Main.peer.xActive"))
        plc.write({"Main.to.sAddr": "127.0.0.1", "Main.shout": True})
        self.wait(plc, lambda: plc.read("Main.datagrams") == 1 and not plc.read("Main.shout"))
        assert plc.read("Main.receive.ipFrom.sAddr") == "127.0.0.1" and plc.read("Main.receive.uiPortFrom") == port
        self.write(plc, toPort=0, shout=True)
        self.wait(plc, lambda: plc.read("Main.sendError") == INVALID_ADDR)

    def test_sockets_are_closed_by_a_stop_and_opened_anew_by_a_start(self, plc: Controller, port: int) -> None:
        self.write(plc, port=port, listen=True, serve=True, toPort=port)
        self.wait(plc, lambda: plc.read("Main.peer.xActive") and plc.read("Main.server.xActive"))
        self.write(plc, connect=True)
        self.wait(plc, lambda: plc.read("Main.client.xActive"))
        old = plc.read("Main.peer.hPeer")
        plc.stop()
        self.stopped(plc, port)
        plc.start()
        self.wait(plc, lambda: plc.read("Main.client.life.calls.code") == NO_CONNECTION)
        self.wait(plc, lambda: plc.read("Main.peer.xActive") and plc.read("Main.peer.hPeer") != old)
        plc.write({"Main.to.sAddr": "127.0.0.1", "Main.shout": True})
        self.wait(plc, lambda: plc.read("Main.datagrams") == 1)
        self.write(plc, connect=False)
        self.wait(plc, lambda: not plc.read("Main.client.xError"))
        self.write(plc, connect=True)
        self.wait(plc, lambda: plc.read("Main.client.xActive"))

    def stopped(self, plc: Controller, port: int) -> None:
        """Checks, and lets main make a pass."""
        raise NotImplementedError


STEPS = """
PROGRAM Main
VAR
    server, client, peer, udp, got : DINT := -1; step : INT := -1; a : SOCKADDRESS; asize : DINT := 16; set :
        SOCKET_FD_SET;
    ok : ARRAY[0..23] OF BOOL; data : ARRAY[0..99] OF BYTE; text : STRING := 'hello'; from : SOCKADDRESS;
        waiting : DINT; port : UINT;
    name, host : STRING(80); ip : INADDR; value, size, err : DINT;
END_VAR
CASE step OF
0:
    server := SysSockCreate(SOCKET_AF_INET, SOCKET_STREAM, SOCKET_IPPROTO_TCP);
    client := FwSysSockCreate(SOCKET_AF_INET, SOCKET_STREAM, 0);
    a.sin_family := SOCKET_AF_INET;
    a.sin_port := SysSockHtons(port);
    ok[0] := SysSockBind(server, ADR(a), SIZEOF(a)) AND SysSockListen(server, 5);
    ok[1] := SysSockAccept(server, 0, 0) = SOCKET_INVALID AND SysSockGetLastError() = SOCKET_EWOULDBLOCK;
    a.sin_addr := SysSockInetAddr('127.0.0.1');
    ok[2] := NOT SysSockConnect(client, ADR(a), SIZEOF(a)) AND SysSockGetLastError() = SOCKET_EWOULDBLOCK;
    step := 1;
1:
    set.fd_count := 1;
    set.fd_array[0] := client;
    IF SysSockSelect(SOCKET_FD_SETSIZE, 0, ADR(set), 0, 0) = 1 THEN
        peer := SysSockAccept(server, ADR(from), ADR(asize));
        ok[3] := peer > 0 AND from.sin_addr = a.sin_addr;
        ok[4] := SysSockRecv(peer, ADR(data), 100, 0) = -1 AND SysSockGetLastError() = SOCKET_EWOULDBLOCK;
        ok[5] := SysSockSend(client, ADR(text), 5, 0) = 5;
        step := 2;
    END_IF
2:
    set.fd_count := 2;
    set.fd_array[0] := server;
    set.fd_array[1] := peer;
    IF SysSockSelect(SOCKET_FD_SETSIZE, ADR(set), 0, 0, 0) = 1 THEN
        ok[6] := set.fd_array[0] = peer AND set.fd_count = 1
            AND SysSockIoctl(peer, SOCKET_FIONREAD, ADR(waiting)) = 0 AND waiting = 5;
        ok[20] := SysSockRecv(peer, ADR(data), 3, SOCKET_MSG_PEEK) = 3 AND data[2] = 16#6C;
        ok[7] := SysSockRecv(peer, ADR(data), 100, 0) = 5 AND data[4] = 16#6F;
        ok[8] := SysSockShutdown(client, SOCKET_SD_BOTH) AND SysSockSend(client, ADR(text), 5, 0) = -1
            AND SysSockGetLastError() = SOCKET_ESHUTDOWN;
        ok[9] := SysSockClose(client) AND NOT SysSockClose(client) AND SysSockGetLastError() = SOCKET_EBADF;
        step := 3;
    END_IF
3:
    got := FwSysSockRecv(peer, ADR(data), 100, 0);
    IF got = 0 THEN
        udp := SysSockCreate(SOCKET_AF_INET, SOCKET_DGRAM, SOCKET_IPPROTO_UDP);
        ok[10] := SysSockBind(udp, ADR(a), SIZEOF(a));
        client := SysSockCreate(SOCKET_AF_INET, SOCKET_DGRAM, SOCKET_IPPROTO_UDP);
        ok[11] := SysSockSendTo(client, ADR(text), 5, 0, ADR(a), SIZEOF(a)) = 5;
        step := 4;
    END_IF
4:
    got := SysSockRecvFrom(udp, ADR(data), 100, SOCKET_MSG_PEEK, 0, 0);
    IF got = 5 THEN
        ok[21] := SysSockRecvFrom(udp, ADR(data), 100, 8, 0, 0) = -1 AND SysSockGetLastError() = SOCKET_ENOSYS;
        ok[22] := FwSysSockGetHostName(ADR(host), 81) AND LEN(host) > 0
            AND NOT SysSockGetHostName(ADR(host), INT_TO_DINT(LEN(host))) AND SysSockGetLastError() = SOCKET_EFAULT;
        ok[23] := NOT FwSysSockSetIPAddress('Ethernet1', '10.0.0.1', '255.0.0.0')
            AND SysSockGetLastError() = SOCKET_ENOSYS;
    END_IF
    got := SysSockRecvFrom(udp, ADR(data), 100, 0, ADR(from), SIZEOF(from));
    IF got = 5 THEN
        ok[12] := from.sin_addr = a.sin_addr AND from.sin_port <> 0 AND data[0] = 16#68;
        ok[13] := SysSockRecvFrom(udp, ADR(data), 100, 0, 0, 0) = -1 AND SysSockGetLastError() = SOCKET_EWOULDBLOCK;
        ip.S_addr := SysSockInetAddr('10.1.2.33');
        ok[14] := FwSysSockInetNtoa(ADR(ip), name, 20) AND name = '10.1.2.33'
            AND NOT SysSockInetNtoa(ADR(ip), name, 9);
        ok[15] := SysSockInetAddr('10.1.2') = 16#FFFFFFFF;
        value := 1;
        ok[16] := SysSockSetOption(udp, SOCKET_SOL, SOCKET_SO_BROADCAST, ADR(value), 4)
            AND NOT SysSockSetOption(udp, SOCKET_SOL, SOCKET_SO_RCVBUF, ADR(value), 4)
            AND SysSockGetLastError() = SOCKET_ENOPROTOOPT;
        step := 5;
        SysSockClose(server);
        client := SysSockCreate(SOCKET_AF_INET, SOCKET_STREAM, 0);
        SysSockConnect(client, ADR(a), SIZEOF(a));
    END_IF
5:
    set.fd_count := 1;
    set.fd_array[0] := client;
    IF SysSockSelect(SOCKET_FD_SETSIZE, 0, 0, ADR(set), 0) = 1 THEN
        size := 4;
        ok[17] := SysSockGetOption(client, SOCKET_SOL, SOCKET_SO_ERROR, ADR(err), ADR(size))
            AND err = SOCKET_ECONNRESET;
        ok[18] := NOT SysSockBind(client, 0, 16) AND SysSockGetLastError() = SOCKET_EFAULT;
        ok[19] := SysSockCreate(1, SOCKET_STREAM, 0) = -1 AND SysSockGetLastError() = SOCKET_EAFNOSUPPORT;
        step := 6;
    END_IF
END_CASE
END_PROGRAM
"""
"""With the functions of SysLibSockets and FastwelSysLibSockets: when `step` is 6, each of `ok` is TRUE."""


def check_steps(plc: Controller, port: int, wait: Callable[[Callable[[], Any]], None]) -> None:
    """Runs STEPS to its end."""
    plc.write({"Main.port": port, "Main.step": 0})
    wait(lambda: plc.read("Main.step") == 6)
    assert [i for i, good in enumerate(plc.read("Main.ok")) if not good] == []
    plc.stop()
    plc.start()
    plc.write({"Main.step": 4})  # a stop has closed all sockets
    wait(lambda: plc.read("Main.got") == -1)


FLOOD = """
PROGRAM Main
VAR
    go : BOOL; made, refused, bound, i, socket : DINT; a : SOCKADDRESS;
END_VAR
IF go THEN
    a.sin_family := SOCKET_AF_INET;
    FOR i := 1 TO 10000 DO
        socket := SysSockCreate(SOCKET_AF_INET, SOCKET_DGRAM, SOCKET_IPPROTO_UDP);
        IF socket = SOCKET_INVALID THEN
            refused := refused + BOOL_TO_DINT(SysSockGetLastError() = SOCKET_ENFILE);
        ELSE
            made := made + 1;
            bound := bound + BOOL_TO_DINT(SysSockBind(socket, ADR(a), SIZEOF(a)));
        END_IF
    END_FOR
    go := FALSE;
END_IF
END_PROGRAM
"""
"""Opens 10 000 sockets and closes none."""
SOCKETS = 64


def check_flood(plc: Controller, wait: Callable[[Callable[[], Any]], None], stopped: Callable[[], None]) -> None:
    """The program is refused past the limit, and again after a start. `stopped` lets main close the sockets."""
    for _ in range(2):
        plc.write({"Main.made": 0, "Main.refused": 0, "Main.bound": 0})
        plc.write({"Main.go": True})
        wait(lambda: not plc.read("Main.go"))
        values = plc.read("Main.made", "Main.refused", "Main.bound")
        assert list(values.values()) == [SOCKETS, 10_000 - SOCKETS, SOCKETS]
        plc.stop()
        stopped()
        plc.start()
