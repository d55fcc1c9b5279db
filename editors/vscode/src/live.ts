// The view of live values: one `plctool watch` for all that is watched, `write` and `force` for single values.

import { spawn, type ChildProcess } from 'node:child_process';
import * as vscode from 'vscode';

import { Lines } from './lines';
import { activeFile, complain, folderOf, LANGUAGE, settings, target, tool } from './setup';
import { runJson, projectOf } from './tool';
import { childrenOf, entriesOf, isPattern, literal, nameAt, qualified, readingOf, type Entry, type Reading } from './values';

const WATCHED = 'plctool.watched';

export class LiveValues implements vscode.TreeDataProvider<Entry>, vscode.Disposable {
  private readonly changed = new vscode.EventEmitter<undefined>();
  readonly onDidChangeTreeData = this.changed.event;
  private reading: Reading | undefined;
  private watching: ChildProcess | undefined;
  private readonly view: vscode.TreeView<Entry>;
  private readonly registered: vscode.Disposable;

  constructor(private readonly memory: vscode.Memento) {
    this.view = vscode.window.createTreeView('plctool.values', { treeDataProvider: this });
    const command = (name: string, action: (entry?: Entry) => unknown): vscode.Disposable =>
      vscode.commands.registerCommand(`plctool.values.${name}`, action);
    this.registered = vscode.Disposable.from(
      this.view,
      this.changed,
      command('add', () => this.add()),
      command('start', () => { this.start(); }),
      command('stop', () => { this.stop(); }),
      command('remove', (entry) => this.remove(entry)),
      command('write', (entry) => this.set('write', entry)),
      command('force', (entry) => this.set('force', entry)),
      command('unforce', (entry) => this.unforce(entry)),
    );
  }

  getTreeItem(entry: Entry): vscode.TreeItem {
    const { None, Collapsed } = vscode.TreeItemCollapsibleState;
    const item = new vscode.TreeItem(entry.label, entry.hasChildren ? Collapsed : None);
    item.id = entry.name ?? '';
    if (entry.name === undefined) delete item.id;
    item.description = entry.hasChildren ? '' : literal(entry.value) + (entry.isForced ? '  forced' : '');
    item.tooltip = entry.name ?? entry.label;
    item.contextValue = this.kindOf(entry);
    if (entry.isForced) item.iconPath = new vscode.ThemeIcon('lock');
    return item;
  }

  private kindOf(entry: Entry): string {
    const kinds = [];
    if (entry.name !== undefined && !entry.hasChildren) kinds.push('value');
    if (entry.isForced) kinds.push('forced');
    if (entry.name !== undefined && this.watched.includes(entry.name)) kinds.push('watched');
    return kinds.join(' ');
  }

  getChildren(entry?: Entry): Entry[] {
    return entry === undefined ? entriesOf(this.watched, this.reading) : childrenOf(entry, this.reading);
  }

  private get watched(): string[] {
    return this.memory.get<string[]>(WATCHED, []);
  }

  private async setWatched(names: string[]): Promise<void> {
    await this.memory.update(WATCHED, names);
    if (names.length === 0) this.stop();
    else this.start();
    this.changed.fire(undefined);
  }

  private async add(): Promise<void> {
    const name = await vscode.window.showInputBox({
      title: 'Watch a variable',
      prompt: 'Such as Main.lamp, Main.list[3] or Main.pump.*',
      value: nameAtCursor(),
    });
    if (name !== undefined && name.trim() !== '' && !this.watched.includes(name.trim())) {
      await this.setWatched([...this.watched, name.trim()]);
    }
  }

  private async remove(entry?: Entry): Promise<void> {
    if (entry?.name !== undefined) await this.setWatched(this.watched.filter((name) => name !== entry.name));
  }

  private start(): void {
    this.stop();
    const cwd = projectFolder();
    if (this.watched.length === 0 || cwd === undefined) return;
    const { path, environment } = tool();
    const args = ['watch', '--json', '--interval', String(settings().get('watchInterval', 0.5)), ...this.watched];
    const child = spawn(path, args, { cwd, env: { ...process.env, ...environment }, stdio: ['ignore', 'pipe', 'pipe'] });
    const lines = new Lines();
    let said = '';
    child.stdout.setEncoding('utf8').on('data', (piece: string) => {
      if (this.watching === child) lines.add(piece).forEach((line) => { this.take(line); });
    });
    child.stderr.setEncoding('utf8').on('data', (piece: string) => (said = (said + piece).slice(-2000)));
    child.on('error', (error) => { this.ended(child, error.message); });
    child.on('close', (code) => { this.ended(child, code === 0 ? '' : said.trim()); });
    this.watching = child;
    this.show('');
  }

  private take(line: string): void {
    try {
      this.reading = readingOf(line) ?? this.reading;
      this.show('');
    } catch (error) {
      this.show(error instanceof Error ? error.message : String(error));
    }
    this.changed.fire(undefined);
  }

  /** The values that were read last stay, with the reason why there are no newer ones. */
  private ended(child: ChildProcess, message: string): void {
    if (this.watching !== child) return;
    this.watching = undefined;
    if (message !== '') this.show(message);
    void vscode.commands.executeCommand('setContext', 'plctool.watching', false);
  }

  private stop(): void {
    const child = this.watching;
    this.watching = undefined;
    child?.kill('SIGINT');
    this.show('');
  }

  private show(message: string): void {
    this.view.message = message === '' ? (undefined as unknown as string) : message;
    void vscode.commands.executeCommand('setContext', 'plctool.watching', this.watching !== undefined);
  }

  private async set(command: 'write' | 'force', entry?: Entry): Promise<void> {
    if (entry?.name === undefined) return;
    const value = await vscode.window.showInputBox({
      title: `${command === 'write' ? 'Write' : 'Force'} ${entry.name}`,
      prompt: command === 'write' ? 'The program may write it again.' : 'It keeps this value until the force ends.',
      value: literal(entry.value),
    });
    if (value !== undefined) await this.tell([command, `${entry.name}=${value}`]);
  }

  private async unforce(entry?: Entry): Promise<void> {
    if (entry?.name !== undefined) await this.tell(['unforce', entry.name]);
  }

  private async tell(args: string[]): Promise<void> {
    const cwd = projectFolder();
    if (cwd === undefined) return;
    try {
      await runJson(tool(), args, cwd);
    } catch (error) {
      complain(error);
    }
  }

  dispose(): void {
    this.stop();
    this.registered.dispose();
  }
}

/** The folder of the project, whose plc.toml says where its controller is. */
function projectFolder(): string | undefined {
  const file = activeFile();
  const folder = folderOf(file);
  if (file?.scheme === 'file' && folder !== undefined) return projectOf(file.fsPath, folder) ?? folder;
  return target()?.folder;
}

function nameAtCursor(): string {
  const editor = vscode.window.activeTextEditor;
  if (editor?.document.languageId !== LANGUAGE) return '';
  const { document, selection } = editor;
  const name = nameAt(document.lineAt(selection.active).text, selection.active.character);
  if (name === undefined || isPattern(name)) return '';
  const before = document.getText(new vscode.Range(new vscode.Position(0, 0), selection.active));
  return qualified(name, before.split('\n'));
}
