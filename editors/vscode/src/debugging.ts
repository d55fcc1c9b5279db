// The debug adapter, `plctool dap`, and the configuration of a program without launch.json.

import { readFile } from 'node:fs/promises';
import * as path from 'node:path';
import * as vscode from 'vscode';

import { activeFile, folderOf, settings, target, tool } from './setup';
import { linkIn } from './tool';

export function registerDebugging(hasAdapter: boolean): vscode.Disposable {
  return vscode.Disposable.from(
    vscode.debug.registerDebugConfigurationProvider('plctool', {
      resolveDebugConfiguration: (folder, configuration) => resolved(folder, configuration, hasAdapter),
    }),
    vscode.debug.registerDebugAdapterDescriptorFactory('plctool', {
      createDebugAdapterDescriptor: (session) => {
        const { path: command, environment } = tool();
        const cwd = session.workspaceFolder?.uri.fsPath ?? folderOf();
        const options = { env: { ...environment }, ...(cwd === undefined ? {} : { cwd }) };
        return new vscode.DebugAdapterExecutable(command, ['dap'], options);
      },
    }),
  );
}

async function resolved(
  folder: vscode.WorkspaceFolder | undefined,
  configuration: vscode.DebugConfiguration,
  hasAdapter: boolean,
): Promise<vscode.DebugConfiguration | undefined> {
  if (!hasAdapter) {
    void vscode.window.showErrorMessage('This plctool has no debug adapter; update it.');
    return undefined;
  }
  const program = target(activeFile())?.path ?? folder?.uri.fsPath;
  const isAttached = configuration.request === 'attach';
  const link = isAttached && configuration.dump === undefined ? await linkOf(program) : '';
  return {
    ...(isAttached || program === undefined ? {} : { program }),
    ...(link === '' ? {} : { link }),
    ...configuration,
    type: 'plctool',
    request: isAttached ? 'attach' : 'launch',
    name: configuration.name === '' ? 'Debug in the simulator' : configuration.name,
  };
}

async function linkOf(project: string | undefined): Promise<string> {
  const link = settings().get<string>('link', '');
  if (link !== '' || project === undefined) return link;
  return linkIn(await readFile(path.join(project, 'plc.toml'), 'utf8').catch(() => ''));
}
