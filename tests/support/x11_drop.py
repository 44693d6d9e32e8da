"""What xdotool cannot do, by libX11 itself: lets a file fall on a window (XDND, as a file manager does), and tells a
display how large its text shall be.

    with X11(":1") as x: x.drop(window, 100, 100, "/path/to/file")
"""
import ctypes
import time
import urllib.parse

CLIENT_MESSAGE, SELECTION_REQUEST, SELECTION_NOTIFY = 33, 30, 31
ATOM, STRING, REPLACE, CURRENT_TIME = 4, 31, 0, 0


class ClientMessage(ctypes.Structure):
    _fields_ = [("type", ctypes.c_int), ("serial", ctypes.c_ulong), ("send_event", ctypes.c_int),
                ("display", ctypes.c_void_p), ("window", ctypes.c_ulong), ("message", ctypes.c_ulong),
                ("format", ctypes.c_int), ("data", ctypes.c_long * 5)]


class SelectionRequest(ctypes.Structure):
    _fields_ = [("type", ctypes.c_int), ("serial", ctypes.c_ulong), ("send_event", ctypes.c_int),
                ("display", ctypes.c_void_p), ("owner", ctypes.c_ulong), ("requestor", ctypes.c_ulong),
                ("selection", ctypes.c_ulong), ("target", ctypes.c_ulong), ("property", ctypes.c_ulong),
                ("time", ctypes.c_ulong)]


class Selection(ctypes.Structure):
    _fields_ = [("type", ctypes.c_int), ("serial", ctypes.c_ulong), ("send_event", ctypes.c_int),
                ("display", ctypes.c_void_p), ("requestor", ctypes.c_ulong), ("selection", ctypes.c_ulong),
                ("target", ctypes.c_ulong), ("property", ctypes.c_ulong), ("time", ctypes.c_ulong)]


class Event(ctypes.Union):
    _fields_ = [("type", ctypes.c_int), ("client", ClientMessage), ("request", SelectionRequest),
                ("selection", Selection), ("pad", ctypes.c_long * 24)]


class X11:
    def __init__(self, name):
        self.lib = ctypes.CDLL("libX11.so.6")
        self.lib.XOpenDisplay.restype = ctypes.c_void_p
        for call in ("XDefaultRootWindow", "XCreateSimpleWindow", "XInternAtom"):
            getattr(self.lib, call).restype = ctypes.c_ulong
        self.name = name

    def __enter__(self):
        self.display = ctypes.c_void_p(self.lib.XOpenDisplay(self.name.encode()))
        assert self.display.value, f"display {self.name} cannot be opened"
        self.root = self.lib.XDefaultRootWindow(self.display)
        return self

    def __exit__(self, *_):
        self.lib.XCloseDisplay(self.display)

    def atom(self, name):
        return self.lib.XInternAtom(self.display, name.encode(), 0)

    def set_property(self, window, name, kind, text):
        self.lib.XChangeProperty(self.display, ctypes.c_ulong(window), ctypes.c_ulong(name), ctypes.c_ulong(kind), 8,
                                 REPLACE, text, len(text))

    def set_text_scale(self, scale):
        self.set_property(self.root, self.atom("RESOURCE_MANAGER"), STRING, f"Xft.dpi:\t{96 * scale:g}\n".encode())
        self.lib.XSync(self.display, 0)

    # ---- drag and drop, protocol version 5

    def send(self, window, event):
        self.lib.XSendEvent(self.display, ctypes.c_ulong(window), 0, ctypes.c_long(0), ctypes.byref(event))
        self.lib.XFlush(self.display)

    def tell(self, target, source, message, *data):
        event = Event()
        event.client = ClientMessage(CLIENT_MESSAGE, 0, 1, self.display, target, self.atom(message), 32,
                                     (ctypes.c_long * 5)(source, *data))
        self.send(target, event)

    def wait(self, wanted, patience_s=60):
        """The next event for which wanted says yes."""
        end, event = time.monotonic() + patience_s, Event()
        while time.monotonic() < end:
            if not self.lib.XPending(self.display):
                time.sleep(0.01)
                continue
            self.lib.XNextEvent(self.display, ctypes.byref(event))
            if wanted(event):
                return event
        raise AssertionError("the window does not answer to a drop")

    def is_message(self, name):
        atom = self.atom(name)
        return lambda event: event.type == CLIENT_MESSAGE and event.client.message == atom

    def drop(self, target, x, y, path):
        uris, selection = self.atom("text/uri-list"), self.atom("XdndSelection")
        source = self.lib.XCreateSimpleWindow(self.display, ctypes.c_ulong(self.root), 0, 0, 1, 1, 0, 0, 0)
        self.lib.XSetSelectionOwner(self.display, ctypes.c_ulong(selection), ctypes.c_ulong(source), CURRENT_TIME)
        self.tell(target, source, "XdndEnter", 5 << 24, uris, 0, 0)
        self.tell(target, source, "XdndPosition", 0, x << 16 | y, CURRENT_TIME, self.atom("XdndActionCopy"))
        self.wait(self.is_message("XdndStatus"))
        self.tell(target, source, "XdndDrop", 0, CURRENT_TIME, 0, 0)
        asked = self.wait(lambda event: event.type == SELECTION_REQUEST).request
        self.set_property(asked.requestor, asked.property, asked.target,
                          f"file://{urllib.parse.quote(str(path))}\r\n".encode())
        event = Event()
        event.selection = Selection(SELECTION_NOTIFY, 0, 1, self.display, asked.requestor, asked.selection,
                                    asked.target, asked.property, asked.time)
        self.send(asked.requestor, event)
        self.wait(self.is_message("XdndFinished"))
