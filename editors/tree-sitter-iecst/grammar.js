// tree-sitter grammar of Structured Text as plctool takes it (host/plctool/compiler/syntax/grammar.lark).
//
// It accepts more than the compiler does where that keeps half-written text readable: the parts of a POU may stand in
// any order. Keywords that the compiler takes as names where they mean nothing are names here by the state of the
// parser; `_name` lists those that mean something where a name may stand.
//
// SPDX-License-Identifier: Apache-2.0

/// <reference types="tree-sitter-cli/dsl" />
// @ts-check

/** A keyword in any case; in the tree it has the name in capitals. */
function keyword(word) {
  const pattern = [...word].map((c) => (/[A-Z]/.test(c) ? `[${c}${c.toLowerCase()}]` : c)).join('');
  return alias(new RegExp(pattern), word);
}

/** One of several keywords. */
function keywords(...words) {
  return choice(...words.map(keyword));
}

function list1(rule) {
  return seq(rule, repeat(seq(',', rule)));
}

function list(rule) {
  return optional(list1(rule));
}

// From the loosest to the tightest, all of them from left to right.
const BINARY = [
  ['OR', 'OR_ELSE'],
  ['XOR'],
  ['AND', 'AND_THEN', '&'],
  ['=', '<>'],
  ['<', '>', '<=', '>='],
  ['+', '-'],
  ['*', '/', 'MOD'],
  ['**'],
];
const UNARY = BINARY.length + 1;

const MODIFIERS = ['PUBLIC', 'PRIVATE', 'PROTECTED', 'INTERNAL', 'FINAL', 'ABSTRACT', 'OVERRIDE'];
const QUALIFIERS = ['CONSTANT', 'RETAIN', 'NON_RETAIN', 'PERSISTENT'];

// Keywords only if a name follows (AT: an address).
const OPENING = [
  'MOCK', 'MOCK_FUNCTION', 'METHOD', 'PROPERTY', 'ACTION', 'NAMESPACE', 'USING', 'INITIAL_STEP', 'STEP', 'TRANSITION',
  'PROPERTY_GET', 'PROPERTY_SET', 'AT', 'JMP', 'POINTER', 'REFERENCE', ...MODIFIERS,
];

module.exports = grammar({
  name: 'iecst',

  word: ($) => $.identifier,

  externals: ($) => [$.comment, $._number_with_point],

  extras: ($) => [/\s|\uFEFF/, $.comment, $.pragma],

  supertypes: ($) => [$._statement, $._expression, $._type],

  conflicts: ($) => [
    // In a CASE a name begins a statement or the labels of the next branch.
    [$.case_block],
    [$.case_branch],
    // `(a := 1)` as initial value: of a structure, or an assignment as value.
    [$.member_initializer, $._name_of_value],
    // `NOT (a := 1` is an assignment as value, or a call with several named arguments.
    [$.input_argument, $._name_of_value],
  ],

  rules: {
    source_file: ($) => repeat(choice($._unit, ';')),

    _unit: ($) =>
      choice(
        $.type_block,
        $.function,
        $.function_block,
        $.program,
        alias($.global_block, $.variable_block),
        $.configuration,
        $.test,
        $.setup,
        $.class,
        $.interface,
        $.namespace,
        $.using,
        $._member,
        $.config_block,
        $.access_block,
      ),

    // ---- types ----

    type_block: ($) => seq(keyword('TYPE'), repeat($.type_declaration), keyword('END_TYPE')),

    type_declaration: ($) =>
      prec.right(
        seq(
          repeat($.modifier),
          field('name', $._name),
          optional($.extends),
          ':',
          field('type', $._type),
          optional(seq(':=', field('value', $._initializers))),
          optional(';'),
        ),
      ),

    _type: ($) =>
      choice(
        prec(-1, $.named_type),
        $.string_type,
        $.initialised_type,
        $.subrange_type,
        $.enumeration_type,
        $.array_type,
        $.pointer_type,
        $.structure_type,
      ),

    named_type: ($) => $._qualified_name,
    string_type: ($) =>
      prec.right(
        seq(
          keywords('STRING', 'WSTRING'),
          optional(choice(seq('[', field('length', $._expression), ']'), seq('(', field('length', $._expression), ')'))),
        ),
      ),
    initialised_type: ($) => seq($.named_type, $.array_initializer),
    subrange_type: ($) => seq(field('base', $.named_type), '(', $.range, ')'),
    range: ($) => seq(field('from', $._expression), '..', field('to', $._expression)),
    enumeration_type: ($) =>
      prec.right(
        choice(
          seq('(', list1($.enumerator), ')', optional(field('base', alias($.identifier, $.named_type)))),
          seq(field('base', $.named_type), '(', list($._type_argument), optional(','), ')'),
        ),
      ),
    enumerator: ($) => seq(field('name', $._name), optional(seq(':=', field('value', $._initializer)))),
    _type_argument: ($) => choice($._expression, alias($.enumerator_with_value, $.enumerator)),
    enumerator_with_value: ($) => seq(field('name', $._name), ':=', field('value', $._initializer)),
    array_type: ($) => seq(keyword('ARRAY'), '[', list1(choice($.range, '*')), ']', keyword('OF'), field('element', $._type)),
    pointer_type: ($) =>
      seq(choice(seq(keywords('POINTER', 'REFERENCE'), keyword('TO')), keyword('REF_TO')), field('target', $._type)),
    structure_type: ($) =>
      seq(
        keywords('STRUCT', 'UNION'),
        optional(keyword('OVERLAP')),
        repeat(choice($.variable_declaration, ';')),
        keywords('END_STRUCT', 'END_UNION'),
      ),

    // ---- variables ----

    variable_block: ($) =>
      prec.right(
        seq(
          keywords(
            'VAR', 'VAR_INPUT', 'VAR_OUTPUT', 'VAR_IN_OUT', 'VAR_TEMP', 'VAR_STAT', 'VAR_EXTERNAL', 'VAR_INST',
          ),
          $._variables,
          optional(';'),
        ),
      ),
    global_block: ($) => seq(keyword('VAR_GLOBAL'), $._variables),
    _variables: ($) =>
      seq(
        repeat(choice($.qualifier, $.modifier)),
        repeat(choice($.variable_declaration, ';')),
        keyword('END_VAR'),
      ),
    qualifier: () => keywords(...QUALIFIERS),
    modifier: () => keywords(...MODIFIERS),

    variable_declaration: ($) =>
      seq(
        choice(seq(list1(field('name', $._name)), optional($.location)), $.location),
        ':',
        field('type', $._type),
        optional(keywords('R_EDGE', 'F_EDGE')),
        optional(
          choice(
            seq(':=', field('value', $._initializers)),
            seq(alias($._reference_assign, 'REF='), field('value', $._expression)),
          ),
        ),
        ';',
      ),
    location: ($) => seq(keyword('AT'), $.address),
    _reference_assign: () => seq(/[Rr][Ee][Ff]/, '='),

    _initializers: ($) => choice($._initializer, alias($.open_array, $.array_initializer)),
    open_array: ($) => choice($.repetition, seq($._array_item, repeat1(seq(',', $._array_item)))),
    _initializer: ($) => choice($._expression, $.array_initializer, $.structure_initializer),
    array_initializer: ($) => seq('[', list1($._array_item), ']'),
    _array_item: ($) => choice($._initializer, $.repetition),
    repetition: ($) => seq(field('count', $.number), '(', list($._initializer), ')'),
    structure_initializer: ($) =>
      prec.dynamic(
        1,
        choice(
          seq('(', ')'),
          seq('(', $.member_initializer, repeat(seq(',', choice($.member_initializer, $._array_item))), optional(','), ')'),
          seq('(', $._expression, repeat1(seq(',', choice($.member_initializer, $._initializer))), optional(','), ')'),
        ),
      ),
    member_initializer: ($) => seq(field('name', $._name), ':=', field('value', $._initializer)),

    // ---- POUs ----

    function: ($) =>
      seq(
        keyword('FUNCTION'),
        repeat($.modifier),
        field('name', $._name),
        optional($._result),
        optional($._body),
        keyword('END_FUNCTION'),
      ),
    _result: ($) => seq(':', field('type', $._type)),
    function_block: ($) =>
      seq(keyword('FUNCTION_BLOCK'), $._head, optional($.implements), optional($._body), keyword('END_FUNCTION_BLOCK')),
    program: ($) =>
      seq(keyword('PROGRAM'), repeat($.modifier), field('name', $._name), optional($._body), keyword('END_PROGRAM')),
    class: ($) => seq(keyword('CLASS'), $._head, optional($.implements), optional($._body), keyword('END_CLASS')),
    interface: ($) => seq(keyword('INTERFACE'), $._head, repeat(choice($._member, ';')), keyword('END_INTERFACE')),
    _head: ($) => seq(repeat($.modifier), field('name', $._name), optional($.extends)),
    extends: ($) => seq(keyword('EXTENDS'), list1($.named_type)),
    implements: ($) => seq(keyword('IMPLEMENTS'), list1($.named_type)),

    // The declarations, statements, members and chart of a POU.
    _body: ($) =>
      repeat1(choice($._statement, $.label, $.variable_block, $.using, $.access_block, $._member, $.step, $.transition)),

    namespace: ($) =>
      seq(
        keyword('NAMESPACE'),
        repeat($.modifier),
        field('name', $.named_type),
        repeat(choice($._unit, ';')),
        keyword('END_NAMESPACE'),
      ),
    using: ($) => seq(keyword('USING'), list1($.named_type), ';'),

    _member: ($) => choice($.method, $.property, $.single_accessor, $.action),
    method: ($) =>
      seq(
        keyword('METHOD'),
        repeat($.modifier),
        field('name', $._name),
        optional($._result),
        optional($._body),
        keyword('END_METHOD'),
      ),
    property: ($) =>
      seq(
        keyword('PROPERTY'),
        repeat($.modifier),
        field('name', $._name),
        $._result,
        repeat(choice($.variable_block, $.using, ';')),
        repeat($.accessor),
        keyword('END_PROPERTY'),
      ),
    accessor: ($) =>
      choice(
        seq(keyword('GET'), repeat($.modifier), optional($._body), keyword('END_GET')),
        seq(keyword('SET'), repeat($.modifier), optional($._body), keyword('END_SET')),
      ),
    single_accessor: ($) =>
      seq(
        keywords('PROPERTY_GET', 'PROPERTY_SET'),
        repeat($.modifier),
        field('name', $._name),
        $._result,
        optional($._body),
        keyword('END_PROPERTY'),
      ),
    action: ($) =>
      seq(keyword('ACTION'), field('name', $._name), optional(':'), optional($._body), keyword('END_ACTION')),

    // ---- sequential function charts ----

    step: ($) =>
      seq(
        keywords('INITIAL_STEP', 'STEP'),
        field('name', $._name),
        optional(':'),
        repeat($.call_statement),
        keyword('END_STEP'),
      ),
    transition: ($) =>
      seq(
        keyword('TRANSITION'),
        optional(field('name', $._name)),
        optional(seq('(', field('option', $.identifier), ':=', field('value', $.number), ')')),
        keyword('FROM'),
        field('from', $.steps),
        keyword('TO'),
        field('to', $.steps),
        ':=',
        field('condition', $._expression),
        optional(';'),
        keyword('END_TRANSITION'),
      ),
    steps: ($) => choice($._name, seq('(', list1($._name), ')')),

    // ---- configuration ----

    configuration: ($) =>
      seq(keyword('CONFIGURATION'), field('name', $._name), repeat($._config_item), keyword('END_CONFIGURATION')),
    _config_item: ($) =>
      choice(
        alias($.global_block, $.variable_block),
        $.resource,
        $.task,
        $.program_instance,
        $.config_block,
        $.access_block,
      ),
    resource: ($) =>
      seq(
        keyword('RESOURCE'),
        field('name', $._name),
        keyword('ON'),
        field('processor', $._name),
        repeat($._config_item),
        keyword('END_RESOURCE'),
      ),
    task: ($) => seq(keyword('TASK'), field('name', $._name), '(', list($.member_initializer), ')', ';'),
    program_instance: ($) =>
      seq(
        keyword('PROGRAM'),
        optional($.qualifier),
        field('name', $._name),
        optional(seq(keyword('WITH'), field('task', $._name))),
        ':',
        field('type', $.named_type),
        optional($.arguments),
        ';',
      ),
    config_block: ($) => seq(keyword('VAR_CONFIG'), repeat($.config_line), keyword('END_VAR')),
    config_line: ($) =>
      seq(
        field('variable', $._variable),
        optional($.location),
        ':',
        field('type', $._type),
        optional(seq(':=', field('value', $._initializers))),
        ';',
      ),
    access_block: ($) => seq(keyword('VAR_ACCESS'), repeat($.access_line), keyword('END_VAR')),
    access_line: ($) =>
      seq(
        field('name', $._name),
        ':',
        field('variable', $._variable),
        ':',
        field('type', $._type),
        optional(keywords('READ_ONLY', 'READ_WRITE')),
        ';',
      ),

    // ---- unit tests ----

    test: ($) => seq(keyword('TEST'), field('name', $.string), optional($._body), keyword('END_TEST')),
    setup: ($) =>
      choice(
        seq(keyword('SETUP'), optional($._body), keyword('END_SETUP')),
        seq(keyword('TEARDOWN'), optional($._body), keyword('END_TEARDOWN')),
      ),

    // ---- statements ----

    block: ($) => repeat1(choice($._statement, $.label)),

    _statement: ($) =>
      choice(
        $.assignment,
        $.call_statement,
        $.if_statement,
        $.case_statement,
        $.for_statement,
        $.while_statement,
        $.repeat_statement,
        $.exit_statement,
        $.continue_statement,
        $.return_statement,
        $.try_statement,
        $.jump_statement,
        $.mock_statement,
        $.empty_statement,
      ),

    label: ($) => seq(field('name', $._name), ':'),
    assignment: ($) =>
      seq(
        field('target', $._variable),
        choice(
          seq(choice(':=', '?='), field('value', $._value)),
          seq(field('operator', alias($._set_assign, $.operator)), field('value', $._set_value)),
        ),
        ';',
      ),
    _value: ($) => choice($._expression, $.chained_assignment),
    chained_assignment: ($) => seq(field('target', $._variable), ':=', field('value', $._value)),
    // S=, R=, REF=
    _set_assign: ($) => seq($.identifier, '='),
    _set_value: ($) => choice($._expression, alias($.chained_set, $.chained_assignment)),
    chained_set: ($) =>
      seq(
        field('target', $._variable),
        field('operator', alias($._set_assign, $.operator)),
        field('value', $._set_value),
      ),
    call_statement: ($) => seq($._variable, ';'),

    if_statement: ($) =>
      seq(
        keyword('IF'),
        field('condition', $._condition),
        keyword('THEN'),
        field('consequence', optional($.block)),
        repeat($.elsif_clause),
        optional($.else_clause),
        keyword('END_IF'),
      ),
    elsif_clause: ($) =>
      seq(keyword('ELSIF'), field('condition', $._condition), keyword('THEN'), optional($.block)),
    else_clause: ($) => seq(keyword('ELSE'), optional($.block)),
    _condition: ($) => choice($._expression, $.chained_assignment),

    case_statement: ($) =>
      seq(
        keyword('CASE'),
        field('value', $._expression),
        keyword('OF'),
        repeat($.case_branch),
        optional($.else_clause),
        keyword('END_CASE'),
      ),
    case_branch: ($) => seq(field('labels', $.case_labels), ':', optional(alias($.case_block, $.block))),
    case_labels: ($) => list1(choice($._expression, $.range)),
    case_block: ($) => repeat1($._statement),

    for_statement: ($) =>
      seq(
        keyword('FOR'),
        field('variable', $._variable),
        ':=',
        field('from', $._expression),
        keyword('TO'),
        field('to', $._expression),
        optional(seq(keyword('BY'), field('step', $._expression))),
        keyword('DO'),
        optional($.block),
        keyword('END_FOR'),
      ),
    while_statement: ($) =>
      seq(keyword('WHILE'), field('condition', $._condition), keyword('DO'), optional($.block), keyword('END_WHILE')),
    repeat_statement: ($) =>
      seq(
        keyword('REPEAT'),
        optional($.block),
        keyword('UNTIL'),
        field('condition', $._condition),
        optional(';'),
        keyword('END_REPEAT'),
      ),
    exit_statement: () => seq(keyword('EXIT'), ';'),
    continue_statement: () => seq(keyword('CONTINUE'), ';'),
    return_statement: ($) => seq(keyword('RETURN'), optional(seq('(', field('condition', $._condition), ')')), ';'),
    try_statement: ($) =>
      seq(keyword('__TRY'), optional($.block), optional($.catch_clause), optional($.finally_clause), keyword('__ENDTRY')),
    catch_clause: ($) =>
      prec(1, seq(keyword('__CATCH'), optional(seq('(', field('variable', $._variable), ')')), optional($.block))),
    finally_clause: ($) => seq(keyword('__FINALLY'), optional($.block)),
    jump_statement: ($) => seq(keyword('JMP'), field('label', $._name), ';'),
    mock_statement: ($) =>
      choice(
        seq(keyword('MOCK'), $._variable, ';'),
        seq(keyword('MOCK_FUNCTION'), $._variable, keyword('RETURNS'), field('value', $._expression), ';'),
      ),
    empty_statement: () => ';',

    // ---- expressions ----

    _expression: ($) =>
      choice($.binary_expression, $.unary_expression, $.parenthesized_expression, $._variable, $._literal),

    binary_expression: ($) =>
      choice(
        ...BINARY.flatMap((operators, tightness) =>
          operators.map((operator) =>
            prec.left(
              tightness + 1,
              seq(
                field('left', $._expression),
                field('operator', /[A-Z]/.test(operator) ? keyword(operator) : operator),
                field('right', $._expression),
              ),
            ),
          ),
        ),
      ),
    unary_expression: ($) =>
      prec(UNARY, seq(field('operator', choice('-', '+', keyword('NOT'))), field('operand', $._expression))),
    parenthesized_expression: ($) => seq('(', $._value, ')'),

    // What may be assigned, called or be a value.
    _variable: ($) =>
      choice(
        $._name_of_value,
        $.address,
        $.global_name,
        $.member_expression,
        $.bit_access,
        $.index_expression,
        $.dereference,
        $.call_expression,
      ),
    _name_of_value: ($) => $._name,
    global_name: ($) => seq('.', field('name', $.identifier)),
    member_expression: ($) => seq(field('object', $._variable), '.', field('member', $.identifier)),
    bit_access: ($) => seq(field('object', $._variable), '.', field('bit', choice($.number, $.address))),
    index_expression: ($) => seq(field('array', $._variable), '[', list1(field('index', $._expression)), ']'),
    dereference: ($) => seq(choice($._variable, $.parenthesized_expression), '^'),
    call_expression: ($) =>
      choice(
        seq(field('function', $._variable), field('arguments', $.arguments)),
        seq(field('function', alias($._operator_function, $.identifier)), field('arguments', $.arguments)),
        seq(field('function', alias(/[Nn][Oo][Tt]/, $.identifier)), field('arguments', alias($._not_arguments, $.arguments))),
      ),
    _operator_function: () => keywords('AND', 'OR', 'XOR', 'MOD'),
    // NOT is an operator unless named arguments follow.
    _not_arguments: ($) => seq('(', $.input_argument, repeat1(seq(',', choice($.input_argument, $.output_argument))), ')'),
    arguments: ($) => seq('(', list($._argument), optional(','), ')'),
    _argument: ($) =>
      choice(
        $._expression,
        $.array_type,
        $.pointer_type,
        $.input_argument,
        $.output_argument,
        $.block_with_task,
      ),
    input_argument: ($) => seq(field('name', $._name), ':=', optional(field('value', $._expression))),
    output_argument: ($) =>
      seq(optional(keyword('NOT')), field('name', $._name), '=>', optional(field('value', $._expression))),
    block_with_task: ($) => seq($._name, keyword('WITH'), $._name),

    _literal: ($) => choice($.number, $.typed_literal, $.string, $.boolean, $.null),
    number: ($) => choice($._plain_number, $._number_with_point),
    _plain_number: () => /\d[\d_]*(#\w+|(\.\d[\d_]*)?([eE][+-]?\d+)?)/,
    typed_literal: () =>
      choice(
        /[A-Za-z_]\w*#([+-]?\d[\d_]*(\.[\d_]+)?[eE][+-]?\d+|[+-]?\w+(\.\w+)*(#\w+)?)?/,
        /[lL]?([dD][aA][tT][eE](_[aA][nN][dD]_[tT][iI][mM][eE])?|[dD][tT]|[dD]|[tT][iI][mM][eE]_[oO][fF]_[dD][aA][yY]|[tT][oO][dD])#[\d:._-]+/,
      ),
    string: () => /([wW]?([sS][tT][rR][iI][nN][gG]|[cC][hH][aA][rR])#)?('([^'$\n]|\$[^\n])*'|"([^"$\n]|\$[^\n])*")/,
    boolean: () => keywords('TRUE', 'FALSE'),
    null: () => prec(1, keyword('NULL')),
    address: () => /%([IQMiqm](\*|[XBWDLxbwdl]?\d+(\.\d+)*|[XBWDLxbwdl]?)|[XBWDLxbwdl]\d+)/,

    // ---- names, comments ----

    _qualified_name: ($) => prec.right(seq($._name, repeat(seq('.', $.identifier)))),
    _name: ($) => choice($.identifier, alias($._opening_word, $.identifier), alias($._null_word, $.identifier)),
    _opening_word: () => prec(-1, keywords(...OPENING)),
    _null_word: () => keyword('NULL'),
    identifier: () => /[\p{L}\p{Nl}_][\p{L}\p{N}\p{Pc}]*/,

    pragma: () => token(choice(/\{[^{}]*\}/, /\{\{([^}]|\}[^}])*\}\}/)),
  },
});
