"""The server: takes the editor's messages, answers requests from the trees, and lets programs be checked."""

from __future__ import annotations

import asyncio
import gc
import logging
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from typing import Any, TypeVar

from lsprotocol import types as lsp
from pygls.exceptions import JsonRpcException
from pygls.lsp.server import LanguageServer

from plctool.compiler.base.source import Source
from plctool.lsp import actions, completion, formatting, hierarchy, hover, navigation, symbols, toml_files
from plctool.lsp.checks import Checks, Result
from plctool.lsp.live import PATIENCE, Live
from plctool.lsp.positions import path_of
from plctool.lsp.project import Project
from plctool.lsp.published import SOURCE, Published
from plctool.lsp.session import Place, Refused, Session
from plctool.lsp.tree import Tree
from plctool.version import plctool_version

T = TypeVar("T")
_SWITCH_INTERVAL = 0.001  # seconds that a check may keep the processor from a request
_SECTION = "plctool"  # of the editor's settings


@dataclass
class Settings:
    """What the editor may say. `diagnostics`: typing or save; `delay`: seconds from a key to the check; `link`: of the
    controller whose values are shown."""

    diagnostics: str = "typing"
    delay: float = 0.15
    link: str = ""

    def take(self, said: object) -> None:
        """Takes over what is valid."""
        if not isinstance(said, dict):
            return
        if said.get("diagnostics") in ("typing", "save"):
            self.diagnostics = said["diagnostics"]
        delay = said.get("delay")
        if isinstance(delay, int | float) and 0 <= delay <= 10_000:
            self.delay = delay / 1000
        if isinstance(link := said.get("link"), str):
            self.link = link


class Server(LanguageServer):
    """The language server with its state."""

    def __init__(self) -> None:
        super().__init__("plctool", plctool_version())
        self.session = Session()
        self.settings = Settings()
        self.published = Published(self.session, self.text_document_publish_diagnostics)
        self.loop: asyncio.AbstractEventLoop | None = None
        self.checks: Checks | None = None
        self.live: Live | None = None
        self._told: set[str] = set()
        self.has_configuration = False

    # ---- life ----

    def begin(self, params: lsp.InitializeParams) -> None:
        """Takes over what the editor says of itself."""
        self.loop = asyncio.get_running_loop()
        session, capabilities = self.session, params.capabilities
        session.encoding = self.workspace.position_encoding or lsp.PositionEncodingKind.Utf16
        document = capabilities.text_document
        if document is not None and document.completion is not None:
            item = document.completion.completion_item
            session.snippets = bool(item is not None and item.snippet_support)
        self.settings.take(params.initialization_options)
        self.has_configuration = bool(capabilities.workspace is not None and capabilities.workspace.configuration)
        folders = [folder.uri for folder in params.workspace_folders or []]
        if not folders and (root := params.root_uri):
            folders = [root]
        session.workspace.set_folders(path_of(uri) for uri in folders)

    def load(self) -> None:
        """Loads the programs of the folders and has them checked."""
        if self.checks is None:
            self.checks = Checks(self._in_loop, self._checked, self._failed)
        self.session.workspace.load_folders()
        for project in self.session.workspace.projects:
            self.check(project, 0)
        self.tell()

    def attach(self) -> None:
        """Reads values from the controller that the settings name, from now on."""
        link = self.settings.link
        if self.live is not None and self.live.link != link:
            self.live.close()
            self.live = None
        if link and self.live is None:
            self.live = Live(link)

    async def value_of(self, name: str) -> str:
        """Returns what is said of a variable's value; "" if the controller takes too long."""
        if self.live is None:
            return ""
        asked = asyncio.wrap_future(self.live.ask(name))
        done, _ = await asyncio.wait([asked], timeout=PATIENCE)
        return asked.result() if done else ""

    def end(self) -> None:
        """Ends the threads."""
        if self.live is not None:
            self.live.close()
        if self.checks is not None:
            self.checks.stop()

    def _in_loop(self, make: Callable[[], T]) -> T:
        """Runs a function in the thread of the requests and waits for its result."""
        assert self.loop is not None
        done: Future[T] = Future()

        def run() -> None:
            try:
                done.set_result(make())
            except BaseException as error:
                done.set_exception(error)

        self.loop.call_soon_threadsafe(run)
        return done.result()

    def tell(self) -> None:
        """Shows what has to be said about folders and projects, each only once."""
        for message in self.session.workspace.messages:
            if message not in self._told:
                self._told.add(message)
                self.show(message)
        self.session.workspace.messages.clear()

    def show(self, message: str) -> None:
        """Shows a message to the user."""
        self.window_show_message(lsp.ShowMessageParams(lsp.MessageType.Warning, message))

    # ---- checks ----

    def check(self, project: Project, delay: float | None = None) -> None:
        """Has a program checked after the delay of the settings."""
        if self.checks is None:
            return
        wait = self.settings.delay if delay is None else delay
        self.checks.ask(project, wait)

    def _checked(self, project: Project, result: Result) -> None:
        assert self.loop is not None
        self.loop.call_soon_threadsafe(self._publish, project, result)

    def _publish(self, project: Project, result: Result) -> None:
        sources = result.snapshot.sources
        if project not in self.session.workspace.projects or list(sources) != project.sources:
            return
        if result.files is None:
            self.published.update(project, result.found, sources)
            return
        for source in (source for source in sources if source.path in result.files):
            found = [d for d in result.found if d.file == source.path]
            self.published.update_file(project, source.path, found, source)

    def _failed(self, message: str) -> None:
        assert self.loop is not None
        self.loop.call_soon_threadsafe(self.show, message)

    # ---- open files ----

    def opened(self, uri: str, text: str) -> None:
        """Takes over a text from the editor."""
        path = path_of(uri)
        workspace = self.session.workspace
        known = {id(p) for p in workspace.projects}
        workspace.open_files[path] = text
        self._look_at(path, text)
        project = workspace.project_of(path)
        self.tell()
        if project is not None:
            if id(project) in known:
                project.change(path)
            self.check(project, 0)

    def changed(self, uri: str, text: str) -> None:
        """Takes over a change."""
        path = path_of(uri)
        self.session.workspace.open_files[path] = text
        self._look_at(path, text)
        for project in self.session.workspace.projects_with(path):
            project.change(path)
            if self.settings.diagnostics == "typing":
                self.check(project)

    def _look_at(self, path: str, text: str) -> None:
        """Shows at once what is wrong with a file of settings."""
        if toml_files.is_toml(path):
            found = toml_files.diagnostics(path, text)
            self.published.update_file(path, path, found, Source(path, text))

    def closed(self, uri: str) -> None:
        """Goes back to what the file says."""
        path = path_of(uri)
        workspace = self.session.workspace
        workspace.open_files.pop(path, None)
        if toml_files.is_toml(path):
            self.published.forget(path)
        for project in workspace.projects_with(path):
            project.change(path)
            self.check(project, 0)
        for project in workspace.drop_lonely():
            if self.checks is not None:
                self.checks.drop(project)
            self.published.forget(project)

    def written(self, paths: Sequence[str]) -> None:
        """Takes notice of files that were written, made or deleted."""
        for project in self.session.workspace.files_changed(paths):
            self.check(project)
        self.tell()

    # ---- requests ----

    def text_of(self, uri: str) -> str:
        """Returns the text of a file as the editor has it."""
        return str(self.workspace.get_text_document(uri).source)

    def place(self, params: Any) -> Place | None:
        """Returns where a request is about."""
        return self.session.place(params.text_document.uri, params.position)

    def file(self, uri: str) -> tuple[Project, list[Tree]] | None:
        """Returns the program and the trees of a file."""
        path = path_of(uri)
        project = self.session.workspace.project_of(path)
        return None if project is None else (project, project.trees_of(path))

    def project_with(self, key: str) -> Project | None:
        """Returns the program that has an item."""
        return next((p for p in self.session.workspace.projects if p.names.by_key(key) is not None), None)


def refuse(error: Refused) -> JsonRpcException:
    """Returns the error that the editor shows."""
    return JsonRpcException(str(error), lsp.LSPErrorCodes.RequestFailed)


def make_server() -> Server:
    """Returns a server that answers all requests."""
    server = Server()
    _add_life(server)
    _add_words(server)
    _add_files(server)
    _add_hierarchies(server)
    return server


def _add_life(server: Server) -> None:
    @server.feature(lsp.INITIALIZE)
    def initialize(params: lsp.InitializeParams) -> None:
        server.begin(params)

    @server.feature(lsp.INITIALIZED)
    async def initialized(params: lsp.InitializedParams) -> None:
        if server.has_configuration:
            await configuration()
        server.attach()
        server.load()

    async def configuration() -> None:
        wanted = lsp.ConfigurationParams([lsp.ConfigurationItem(section=_SECTION)])
        try:
            said = await asyncio.wait_for(server.workspace_configuration_async(wanted), 2)
        except (TimeoutError, JsonRpcException):
            return
        server.settings.take(said[0] if said else None)

    @server.feature(lsp.WORKSPACE_DID_CHANGE_CONFIGURATION)
    async def changed_configuration(params: lsp.DidChangeConfigurationParams) -> None:
        if server.has_configuration:
            await configuration()
        elif isinstance(params.settings, dict):
            server.settings.take(params.settings.get(_SECTION))
        server.attach()

    @server.feature(lsp.SHUTDOWN)
    def shutdown(*params: object) -> None:
        server.end()

    @server.feature(lsp.TEXT_DOCUMENT_DID_OPEN)
    def opened(params: lsp.DidOpenTextDocumentParams) -> None:
        server.opened(params.text_document.uri, params.text_document.text)

    @server.feature(lsp.TEXT_DOCUMENT_DID_CHANGE)
    def changed(params: lsp.DidChangeTextDocumentParams) -> None:
        server.changed(params.text_document.uri, server.text_of(params.text_document.uri))

    @server.feature(lsp.TEXT_DOCUMENT_DID_CLOSE)
    def closed(params: lsp.DidCloseTextDocumentParams) -> None:
        server.closed(params.text_document.uri)

    @server.feature(lsp.TEXT_DOCUMENT_DID_SAVE)
    def saved(params: lsp.DidSaveTextDocumentParams) -> None:
        server.written([path_of(params.text_document.uri)])
        project = server.session.workspace.project_of(path_of(params.text_document.uri))
        if project is not None and server.settings.diagnostics == "save":
            server.check(project, 0)

    @server.feature(lsp.WORKSPACE_DID_CHANGE_WATCHED_FILES)
    def watched(params: lsp.DidChangeWatchedFilesParams) -> None:
        server.written([path_of(change.uri) for change in params.changes])

    @server.feature(lsp.WORKSPACE_DID_CHANGE_WORKSPACE_FOLDERS)
    def folders(params: lsp.DidChangeWorkspaceFoldersParams) -> None:
        before = list(server.session.workspace.projects)
        server.session.workspace.set_folders(path_of(uri) for uri in server.workspace.folders)
        for project in before:
            if project not in server.session.workspace.projects:
                server.published.forget(project)
        server.load()


def _add_words(server: Server) -> None:
    session = server.session

    @server.feature(lsp.TEXT_DOCUMENT_HOVER)
    async def hovered(params: lsp.HoverParams) -> lsp.Hover | None:
        place = server.place(params)
        if place is None:
            return None
        name = hover.variable_at(place) if server.live is not None else ""
        shown = hover.hover(session, place)
        if not name or shown is None:
            return shown
        value = await server.value_of(name)
        return hover.hover(session, place, value)

    @server.feature(lsp.TEXT_DOCUMENT_SIGNATURE_HELP, lsp.SignatureHelpOptions(["(", ","]))
    def signature(params: lsp.SignatureHelpParams) -> lsp.SignatureHelp | None:
        place = server.place(params)
        return None if place is None else hover.signature(session, place)

    @server.feature(lsp.TEXT_DOCUMENT_COMPLETION, lsp.CompletionOptions([".", "#", "[", '"'], resolve_provider=True))
    def complete(params: lsp.CompletionParams) -> lsp.CompletionList | None:
        path = path_of(params.text_document.uri)
        if toml_files.is_toml(path):
            projects = session.workspace.projects_with(path)
            names = projects[0].names if projects else None
            return toml_files.completion(path, server.text_of(params.text_document.uri), params.position, names)
        place = server.place(params)
        return None if place is None else completion.completion(session, place)

    @server.feature(lsp.COMPLETION_ITEM_RESOLVE)
    def resolve(item: lsp.CompletionItem) -> lsp.CompletionItem:
        data = item.data if isinstance(item.data, dict) else {}
        project = session.workspace.project_of(str(data.get("uri", "")))
        return item if project is None else completion.resolve(item, project.names)

    @server.feature(lsp.TEXT_DOCUMENT_DEFINITION)
    def definition(params: lsp.DefinitionParams) -> lsp.Location | None:
        place = server.place(params)
        return None if place is None else navigation.definition(session, place)

    @server.feature(lsp.TEXT_DOCUMENT_DECLARATION)
    def declaration(params: lsp.DeclarationParams) -> lsp.Location | None:
        place = server.place(params)
        return None if place is None else navigation.definition(session, place)

    @server.feature(lsp.TEXT_DOCUMENT_TYPE_DEFINITION)
    def type_definition(params: lsp.TypeDefinitionParams) -> lsp.Location | None:
        place = server.place(params)
        return None if place is None else navigation.type_definition(session, place)

    @server.feature(lsp.TEXT_DOCUMENT_IMPLEMENTATION)
    def implementation(params: lsp.ImplementationParams) -> list[lsp.Location]:
        place = server.place(params)
        return [] if place is None else navigation.implementation(session, place)

    @server.feature(lsp.TEXT_DOCUMENT_REFERENCES)
    def references(params: lsp.ReferenceParams) -> list[lsp.Location]:
        place = server.place(params)
        wanted = params.context.include_declaration
        return [] if place is None else navigation.references(session, place, declaration=wanted)

    @server.feature(lsp.TEXT_DOCUMENT_DOCUMENT_HIGHLIGHT)
    def highlights(params: lsp.DocumentHighlightParams) -> list[lsp.DocumentHighlight]:
        place = server.place(params)
        return [] if place is None else navigation.highlights(session, place)

    @server.feature(lsp.TEXT_DOCUMENT_PREPARE_RENAME)
    def prepare_rename(params: lsp.PrepareRenameParams) -> lsp.Range | None:
        place = server.place(params)
        try:
            return None if place is None else navigation.prepare_rename(session, place)
        except Refused as error:
            raise refuse(error) from None

    @server.feature(lsp.TEXT_DOCUMENT_RENAME, lsp.RenameOptions(prepare_provider=True))
    def rename(params: lsp.RenameParams) -> lsp.WorkspaceEdit | None:
        place = server.place(params)
        try:
            return None if place is None else navigation.rename(session, place, params.new_name)
        except Refused as error:
            raise refuse(error) from None

    @server.feature(lsp.TEXT_DOCUMENT_CODE_ACTION, lsp.CodeActionOptions([lsp.CodeActionKind.QuickFix]))
    def code_actions(params: lsp.CodeActionParams) -> list[lsp.CodeAction]:
        found = []
        for diagnostic in params.context.diagnostics:
            place = session.place(params.text_document.uri, diagnostic.range.start)
            if diagnostic.source == SOURCE and place is not None:
                found += actions.code_actions(session, place, diagnostic)
        return found

    @server.feature(lsp.TEXT_DOCUMENT_SELECTION_RANGE)
    def selection(params: lsp.SelectionRangeParams) -> list[lsp.SelectionRange]:
        places = [session.place(params.text_document.uri, position) for position in params.positions]
        return [navigation.selection_ranges(session, place) for place in places if place is not None]


def _add_files(server: Server) -> None:
    session = server.session

    @server.feature(lsp.TEXT_DOCUMENT_DOCUMENT_SYMBOL)
    def document_symbols(params: lsp.DocumentSymbolParams) -> list[lsp.DocumentSymbol]:
        found = server.file(params.text_document.uri)
        return [] if found is None else symbols.document_symbols(session, *found)

    @server.feature(lsp.WORKSPACE_SYMBOL)
    def workspace_symbols(params: lsp.WorkspaceSymbolParams) -> list[lsp.WorkspaceSymbol]:
        return symbols.workspace_symbols(session, session.workspace.projects, params.query)

    legend = lsp.SemanticTokensLegend(symbols.TOKEN_TYPES, symbols.TOKEN_MODIFIERS)

    @server.feature(lsp.TEXT_DOCUMENT_SEMANTIC_TOKENS_FULL, legend)
    def semantic_tokens(params: lsp.SemanticTokensParams) -> lsp.SemanticTokens:
        found = server.file(params.text_document.uri)
        return lsp.SemanticTokens([]) if found is None else symbols.semantic_tokens(session, *found)

    @server.feature(lsp.TEXT_DOCUMENT_FOLDING_RANGE)
    def folding(params: lsp.FoldingRangeParams) -> list[lsp.FoldingRange]:
        found = server.file(params.text_document.uri)
        return [] if found is None else symbols.folding(session, found[1])

    @server.feature(lsp.TEXT_DOCUMENT_INLAY_HINT)
    def inlay_hints(params: lsp.InlayHintParams) -> list[lsp.InlayHint]:
        found = server.file(params.text_document.uri)
        if found is None:
            return []
        return [h for tree in found[1] for h in hierarchy.inlay_hints(session, found[0], tree, params.range)]

    @server.feature(lsp.TEXT_DOCUMENT_FORMATTING)
    def format_file(params: lsp.DocumentFormattingParams) -> list[lsp.TextEdit]:
        return _formatted(server, params.text_document.uri, ())

    @server.feature(lsp.TEXT_DOCUMENT_RANGE_FORMATTING)
    def format_range(params: lsp.DocumentRangeFormattingParams) -> list[lsp.TextEdit]:
        lines = (params.range.start.line + 1, params.range.end.line + (params.range.end.character > 0))
        return _formatted(server, params.text_document.uri, [(lines[0], max(lines))])


def _formatted(server: Server, uri: str, ranges: Sequence[tuple[int, int]]) -> list[lsp.TextEdit]:
    path = path_of(uri)
    project = server.session.workspace.project_of(path)
    try:
        return formatting.format_text(path, server.text_of(uri), project, ranges)
    except Refused as error:
        raise refuse(error) from None


def _add_hierarchies(server: Server) -> None:
    session = server.session

    @server.feature(lsp.TEXT_DOCUMENT_PREPARE_CALL_HIERARCHY)
    def prepare_calls(params: lsp.CallHierarchyPrepareParams) -> list[lsp.CallHierarchyItem]:
        place = server.place(params)
        return [] if place is None else hierarchy.prepare_calls(session, place)

    @server.feature(lsp.CALL_HIERARCHY_INCOMING_CALLS)
    def incoming(params: lsp.CallHierarchyIncomingCallsParams) -> list[lsp.CallHierarchyIncomingCall]:
        key = _key_of(params.item.data)
        project = server.project_with(key)
        return [] if project is None else hierarchy.incoming(session, project, key)

    @server.feature(lsp.CALL_HIERARCHY_OUTGOING_CALLS)
    def outgoing(params: lsp.CallHierarchyOutgoingCallsParams) -> list[lsp.CallHierarchyOutgoingCall]:
        key = _key_of(params.item.data)
        project = server.project_with(key)
        return [] if project is None else hierarchy.outgoing(session, project, key)

    @server.feature(lsp.TEXT_DOCUMENT_PREPARE_TYPE_HIERARCHY)
    def prepare_types(params: lsp.TypeHierarchyPrepareParams) -> list[lsp.TypeHierarchyItem]:
        place = server.place(params)
        return [] if place is None else hierarchy.prepare_types(session, place)

    @server.feature(lsp.TYPE_HIERARCHY_SUPERTYPES)
    def supertypes(params: lsp.TypeHierarchySupertypesParams) -> list[lsp.TypeHierarchyItem]:
        key = _key_of(params.item.data)
        project = server.project_with(key)
        return [] if project is None else hierarchy.supertypes(session, project, key)

    @server.feature(lsp.TYPE_HIERARCHY_SUBTYPES)
    def subtypes(params: lsp.TypeHierarchySubtypesParams) -> list[lsp.TypeHierarchyItem]:
        key = _key_of(params.item.data)
        project = server.project_with(key)
        return [] if project is None else hierarchy.subtypes(session, project, key)


def _key_of(data: object) -> str:
    if isinstance(data, dict):
        return str(data.get("key", ""))
    return str(getattr(data, "key", ""))


def serve() -> None:
    """Serves an editor on the standard input and output until it says goodbye."""
    logging.basicConfig(level=logging.ERROR, stream=sys.stderr)
    sys.setswitchinterval(_SWITCH_INTERVAL)
    gc.disable()  # `Checks` frees memory when nothing is to be done
    gc.freeze()
    output = sys.stdout.buffer
    sys.stdout = sys.stderr  # nothing else may be written between the messages
    make_server().start_io(stdout=output)
