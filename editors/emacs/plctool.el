;;; plctool.el --- Structured Text with plctool  -*- lexical-binding: t; -*-

;; SPDX-License-Identifier: Apache-2.0
;; Version: 0.2.0
;; Package-Requires: ((emacs "28.1"))
;; Keywords: languages

;;; Commentary:

;; (load "editors/emacs/plctool.el") gives files of Structured Text a mode with highlighting, M-x compile (plctool
;; check), M-x plctool-format, and, with Eglot, the language server of plctool, with Dape or dap-mode its debug adapter.
;; Where Emacs has tree-sitter and the parser of editors/tree-sitter-iecst is installed, it highlights.

;;; Code:

(require 'compile)

(defgroup plctool nil "Structured Text with plctool." :group 'languages)

(defcustom plctool-command "plctool" "The plctool to start." :type 'string)

(defconst plctool--source
  (expand-file-name "../tree-sitter-iecst" (file-name-directory (or load-file-name buffer-file-name)))
  "The folder of the tree-sitter grammar.")

(defconst plctool--words
  (let ((query (expand-file-name "queries/highlights.scm" plctool--source)) words)
    (with-temp-buffer
      (insert-file-contents query)
      (while (re-search-forward "\"\\([A-Z_]+\\)\"" nil t) (push (match-string 1) words)))
    (delete-dups (append '("TRUE" "FALSE" "NULL" "CONSTANT" "RETAIN" "PERSISTENT" "PUBLIC" "PRIVATE" "PROTECTED") words)))
  "The keywords and elementary types: those of the queries for tree-sitter.")

(defvar iecst-mode-syntax-table
  (let ((table (make-syntax-table)))
    (modify-syntax-entry ?_ "w" table)
    (modify-syntax-entry ?\( "()1n" table)
    (modify-syntax-entry ?* ". 23n" table)
    (modify-syntax-entry ?\) ")(4n" table)
    (modify-syntax-entry ?/ ". 12b" table)
    (modify-syntax-entry ?\n "> b" table)
    (modify-syntax-entry ?' "\"" table)
    (modify-syntax-entry ?\" "\"" table)
    (modify-syntax-entry ?$ "\\" table)
    table)
  "Comments nest; a $ escapes the next character of a string.")

;;;###autoload
(define-derived-mode iecst-mode prog-mode "ST"
  "Structured Text of IEC 61131-3."
  (setq-local comment-start "// " comment-end "" comment-start-skip "\\(?://+\\|(\\*+\\)\\s *")
  (setq-local font-lock-defaults
              `(((,(concat "\\.\\s *\\(\\w+\\)") 1 font-lock-variable-name-face)
                 (,(regexp-opt plctool--words 'words) . font-lock-keyword-face)
                 ("\\_<[0-9][0-9a-fA-F_#.]*" . font-lock-constant-face)
                 ("%[IQMiqm][XBWDLxbwdl*]?[0-9.]*" . font-lock-constant-face)
                 ("{[^{}]*}" . font-lock-preprocessor-face)
                 ("\\_<\\(\\w+\\)\\s *(" 1 font-lock-function-name-face))
                nil t))
  (setq-local indent-tabs-mode nil tab-width 4 indent-line-function #'indent-relative)
  (setq-local compile-command (concat plctool-command " check "))
  (when (and (fboundp 'treesit-ready-p) (treesit-ready-p 'iecst t))
    (plctool--use-tree-sitter)))

(defun plctool--use-tree-sitter ()
  "Highlight with the parser of editors/tree-sitter-iecst."
  (treesit-parser-create 'iecst)
  (setq-local treesit-font-lock-settings
              (treesit-font-lock-rules
               :language 'iecst :feature 'comment '((comment) @font-lock-comment-face (pragma) @font-lock-preprocessor-face)
               :language 'iecst :feature 'literal
               '((string) @font-lock-string-face [(number) (typed_literal) (boolean) (null) (address)] @font-lock-constant-face)
               :language 'iecst :feature 'name
               '((named_type) @font-lock-type-face
                 (call_expression function: (identifier) @font-lock-function-name-face)
                 (variable_declaration name: (identifier) @font-lock-variable-name-face))
               :language 'iecst :feature 'keyword
               `([,@(seq-filter (lambda (word) (ignore-errors (treesit-query-compile 'iecst `([,word]) t)))
                                plctool--words)]
                 @font-lock-keyword-face)))
  (setq-local treesit-font-lock-feature-list '((comment literal) (keyword name)))
  (treesit-major-mode-setup))

(defun plctool-install-parser ()
  "Compile the tree-sitter parser, which needs a C compiler only."
  (interactive)
  (let* ((folder (locate-user-emacs-file "tree-sitter/"))
         (source (expand-file-name "src" plctool--source))
         (parser (expand-file-name (concat "libtree-sitter-iecst" (or (bound-and-true-p module-file-suffix) ".so")) folder)))
    (make-directory folder t)
    (unless (eql 0 (call-process "cc" nil "*plctool*" nil "-shared" "-fPIC" "-O2" (concat "-I" source)
                                 (expand-file-name "parser.c" source) (expand-file-name "scanner.c" source) "-o" parser))
      (error "The parser was not compiled; see *plctool*"))
    parser))

(defun plctool-format ()
  "Format the buffer with plctool fmt."
  (interactive)
  (let ((formatted (generate-new-buffer " *plctool fmt*")) (errors (make-temp-file "plctool")))
    (unwind-protect
        (if (eql 0 (call-process-region nil nil plctool-command nil (list formatted errors) nil "fmt" "-"))
            (replace-buffer-contents formatted)
          (error "%s" (with-temp-buffer (insert-file-contents errors) (string-trim (buffer-string)))))
      (kill-buffer formatted)
      (delete-file errors))))

;;;###autoload
(add-to-list 'auto-mode-alist '("\\.\\(?:st\\|iec\\|exp\\)\\'" . iecst-mode))

(add-to-list 'compilation-error-regexp-alist-alist
             '(plctool "^\\([^:\n]+\\):\\([0-9]+\\):\\([0-9]+\\): \\(?:error\\|\\(warning\\)\\): " 1 2 3 (4)))
(add-to-list 'compilation-error-regexp-alist 'plctool)

(with-eval-after-load 'eglot
  (add-to-list 'eglot-server-programs (list 'iecst-mode plctool-command "lsp")))

(with-eval-after-load 'dape
  (add-to-list 'dape-configs
               `(plctool modes (iecst-mode) command ,plctool-command command-args ("dap")
                         :type "plctool" :request "launch" :program dape-cwd)))

(with-eval-after-load 'dap-mode
  (dap-register-debug-provider
   "plctool"
   (lambda (settings) (plist-put settings :dap-server-path (list plctool-command "dap"))))
  (dap-register-debug-template
   "plctool: debug this file in the simulator"
   '(:type "plctool" :request "launch" :program "${file}")))

(provide 'plctool)
;;; plctool.el ends here
