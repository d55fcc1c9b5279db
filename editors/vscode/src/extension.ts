// Structured Text in VS Code: what is not declared in package.json is started here, in workspaces that are trusted.

import * as vscode from 'vscode';

import { Server } from './client';
import { registerDebugging } from './debugging';
import { registerFormatter } from './format';
import { LiveValues } from './live';
import { commands, complain } from './setup';
import { openPage, registerTasks, runAction } from './tasks';
import { Tests } from './testing';

export async function activate(context: vscode.ExtensionContext): Promise<void> {
  if (vscode.workspace.isTrusted) {
    await start(context);
  } else {
    context.subscriptions.push(vscode.workspace.onDidGrantWorkspaceTrust(() => { void start(context); }));
  }
}

async function start(context: vscode.ExtensionContext): Promise<void> {
  const server = new Server();
  const command = (name: string, action: () => unknown): vscode.Disposable =>
    vscode.commands.registerCommand(`plctool.${name}`, action);
  context.subscriptions.push(
    server,
    new LiveValues(context.workspaceState),
    new Tests(),
    registerTasks(),
    vscode.workspace.onDidChangeConfiguration((change) => {
      if (change.affectsConfiguration('plctool')) void server.settingsChanged().catch(complain);
    }),
    ...(['check', 'build', 'flash', 'onlineChange', 'simulate'] as const).map((action) =>
      command(action, () => runAction(action)),
    ),
    command('page', () => { openPage(false); }),
    command('simulatorPage', () => { openPage(true); }),
    command('restartServer', () => server.restart().catch(complain)),
  );
  const available = await commands();
  context.subscriptions.push(registerDebugging(available.has('dap')));
  if (available.has('lsp')) await server.start().catch(complain);
  else if (available.has('fmt')) context.subscriptions.push(registerFormatter());
}
